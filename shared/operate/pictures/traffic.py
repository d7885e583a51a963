"""Traffic: a log with its level by verdict, sizes over time (the paper's Figure 12), bandwidth (Figure 13)."""

import math
from collections import defaultdict

import rerun as rr

from operate.pictures.colours import GREY, ORANGE, RED, channel
from operate.pictures.happenings import Happening, Lost
from operate.pictures.sheet import Colour, Sheet, scalars, words
from operate.recording.records import Spoken
from operate.run_folder import Judged
from topdown.judge.verdicts import Verdict
from topdown.model.design import Design

BIN_S = 0.25
"""Of the bandwidth over time; estimate: some ten queries of a search."""
LEVELS = {Verdict.LEGAL: "INFO", Verdict.SLOW: "WARN", Verdict.COPY: "DEBUG", Verdict.NOT_JUDGED: "DEBUG"}
"""Of a line of the log; verdicts that are not named here are against the design: ERROR."""
OTHER = "other"


class Log:
    """A line for each verdict about a communicate."""

    def __init__(self, sheet: Sheet, design: Design) -> None:
        self._sheet, self._channels = sheet, design.channels

    def take(self, happening: Happening) -> None:
        """Write the line."""
        match happening.what:
            case Judged() as one:
                level = LEVELS.get(Verdict(one.verdict), "ERROR")
                what = _line(one.sender, one.receiver, one.performative, one.text, one.bytes) if one.sender else one.key
                why = f"  {one.verdict.upper()}: {one.why}" if level not in ("INFO", "DEBUG") else ""
                self._add(happening.at, one.channel, what + why, level)
            case Lost(samples=count):
                self._add(
                    happening.at, "", f"drawing is too slow: {count} samples not shown (they are recorded)", "WARN"
                )

    def _add(self, at: float, name: str, text: str, level: str) -> None:
        colours: dict[str, Colour] = {"ERROR": RED, "WARN": ORANGE, "DEBUG": GREY}
        where = name if name in self._channels else OTHER
        self._sheet.add(f"communicates/{where}", words, at, (text, level, colours.get(level, channel(name))))


class Sizes:
    """A point for each communicate."""

    def __init__(self, sheet: Sheet, design: Design) -> None:
        self._sheet = sheet
        for name in design.channels:
            look = rr.SeriesPoints(colors=[channel(name)], names=[name], markers=["circle"], marker_sizes=[2.5])
            sheet.static(f"sizes/{name}", look)

    def take(self, happening: Happening) -> None:
        """Draw the point."""
        one = happening.what
        if isinstance(one, Spoken):
            self._sheet.add(f"sizes/{one.channel}", scalars, happening.at, (math.log10(max(one.size, 1)),))


class Bins:
    """Counts by channel in bins of BIN_S; `close` hands out each bin that is over, empty ones too."""

    def __init__(self) -> None:
        self._number: int | None = None
        self._sums: defaultdict[str, float] = defaultdict(float)

    def close(self, at: float) -> list[tuple[float, dict[str, float]]]:
        """Bins that ended before `at` [unix s]: (start, channel -> sum). Long silence is two empty bins, not all."""
        number = int(at / BIN_S)
        if self._number is None:
            self._number = number
        if number <= self._number:
            return []
        done = [(self._number * BIN_S, dict(self._sums))]
        self._sums.clear()
        between = range(self._number + 1, number)
        done += [(k * BIN_S, {}) for k in (between if len(between) < 16 else (*between[:14], between[-1]))]
        self._number = number
        return done

    def add(self, name: str, amount: float) -> None:
        """Count in the bin that is open."""
        self._sums[name] += amount


class Bandwidth:
    """A line for each channel, kbit/s; at rest it is drawn where it begins and ends only."""

    def __init__(self, sheet: Sheet, design: Design) -> None:
        self._sheet, self._channels, self._bins = sheet, design.channels, Bins()
        self._last: dict[str, tuple[float, float]] = {}
        for name in design.channels:
            sheet.static(f"bandwidth/{name}", rr.SeriesLines(colors=[channel(name)], names=[name], widths=[1.5]))

    def pass_time(self, at: float) -> None:
        """Draw the bins that are over."""
        for start, sums in self._bins.close(at):
            for name in self._channels:
                self._point(name, start, sums.get(name, 0.0) * 8 / BIN_S / 1000)

    def take(self, happening: Happening) -> None:
        """Count the bits."""
        if isinstance(happening.what, Spoken):
            self._bins.add(happening.what.channel, happening.what.size)

    def _point(self, name: str, start: float, kbit_s: float) -> None:
        before, last = self._last.get(name, (start, 0.0))
        if kbit_s > 0 and last == 0.0 and name in self._last:
            self._sheet.add(f"bandwidth/{name}", scalars, max(before, start - BIN_S), (0.0,))
        if kbit_s > 0 or last > 0 or name not in self._last:
            self._sheet.add(f"bandwidth/{name}", scalars, start, (kbit_s,))
        self._last[name] = (start, kbit_s)


def _line(sender: str, receiver: str, performative: str, text: str, size: int) -> str:
    return f"{sender} > {receiver}  {performative}{'  ' + text if text else ''}  ({size} B)"
