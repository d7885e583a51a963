"""Sequence diagrams in the terminal: one conversation with its states, or the traffic among many
agents as it goes by.

Pure: lines in, text out, as wide as it is told. The arrows are those of topdown.draw.sequence; here
come the colours.
"""

import textwrap
from collections.abc import Sequence

from rich.cells import cell_len, set_cell_size
from rich.text import Text

from operate.verdict_lines import Judged
from topdown.draw.sequence import Columns
from topdown.judge.verdicts import Verdict

TIME = 9
"""Columns of the time."""
QUIET = {Verdict.LEGAL: "", Verdict.COPY: "dim", Verdict.SLOW: "yellow", Verdict.NOT_JUDGED: "dim"}
MARKS = {Verdict.COPY: "copy", Verdict.SLOW: "slow", Verdict.NOT_JUDGED: "not judged"}


def seconds(span: float) -> str:
    """A span of time in few characters."""
    if span < 0.9995:
        return f"{1000 * span:.0f} ms"
    return f"{span:.2f} s" if span < 100 else f"{span:.0f} s"


def mark(one: Judged) -> str:
    """The verdict in a word, where it is not simply legal."""
    return one.verdict.upper() if one.violation else MARKS.get(Verdict(one.verdict), "")


def _style(one: Judged) -> str:
    return "red" if one.violation else QUIET.get(Verdict(one.verdict), "")


def _fit(words: str, room: int) -> str:
    if cell_len(words) <= room:
        return words
    return set_cell_size(words, max(0, room - 1)) + "…" * (room > 0)


# --- A conversation -------------------------------------------------------------------------------


NEAREST, FARTHEST = 24, 64
"""Columns between the lifelines: fewer would not hold a performative with its size, more is hard to
follow by eye.
"""
STATES = 20
"""Columns of each side's state, where there is room."""


def heading(channel: str, protocol: str, conversation: str, ended: bool) -> Text:
    """Conversation, protocol, channel, and whether it goes on."""
    text = Text.assemble((conversation, "bold"), f"  {protocol} on {channel}  ")
    return text.append("ended" if ended else "goes on", "dim" if ended else "cyan")


def drawn(said: Sequence[Judged], initiator: str, participant: str, width: int) -> Text:
    """The diagram. On an arrow the act and its size, below it what it says; why, where it is not as
    designed.

    Beside an arrow stand the states after it.
    """
    names = (initiator, participant, *(one.initiator for one in said))
    side = min(STATES, max(4, *map(cell_len, names)))
    gap = max(NEAREST, min(FARTHEST, width - TIME - 2 * side - 6))
    columns, indent = Columns((initiator, participant), gap + 1), TIME + side + 2
    head = f"{'':{TIME}} {initiator:>{side}} {'':{gap + 2}} {participant}\n"
    text = Text(head, "bold", no_wrap=True)
    for one in said:
        style, since = _style(one), "+" + seconds(one.t - said[0].t)
        size = f"{one.bytes} B" if one.bytes < 1000 else f"{one.bytes / 1000:.3g} kB"
        act = _fit(f"{one.performative}  {size}", gap)
        left, right = (one.initiator, one.participant) if one.initiator else ("", "")
        text.append(f"{since:>{TIME}} {_fit(left, side):>{side}} ", "dim")
        text.append(columns.arrow(one.sender, one.receiver, act), style)
        text.append(f" {_fit(right, max(0, width - indent - gap - 3))}\n", "dim")
        for words in filter(None, (one.text, mark(one))):
            text.append(f"{'':{indent}}{columns.between(_fit(words, gap))}\n", style or "italic")
        why = one.why if one.violation else ""
        for line in textwrap.wrap(why, max(20, width - indent - 1)):
            text.append(f"{'':{indent + 1}}{line}\n", "red")
    return text


# --- The traffic among many agents: line by line, so that it can be drawn as it goes by -----------


LEAST, MOST = 12, 24
"""Columns from lifeline to lifeline: fewer would cut most performatives, more is hard to follow by
eye (estimates).
"""
WORDS = 24
"""Columns left for what is said beside the lifelines, where the terminal is wide enough."""


class Lifelines:
    """The columns of a diagram: `agents` from left to right, as wide as `width` allows."""

    def __init__(self, agents: Sequence[str], width: int) -> None:
        gaps = max(1, len(agents) - 1)
        self.gap = max(LEAST, min(MOST, (width - TIME - WORDS) // (gaps + 1)))
        self.columns = Columns(agents, self.gap)
        self.first = TIME + 1 + self.gap // 2
        self.end = self.first + self.columns.width
        self.room = max(0, width - self.end - 1)

    def heading(self) -> Text:
        """The names of the agents above their lifelines."""
        line = " " * (TIME + 1) + "".join(
            f"{_fit(name, self.gap - 1):^{self.gap}}" for name in self.columns.at
        )
        return Text(line.rstrip(), "bold", no_wrap=True)

    def row(self, one: Judged, begin: float, room: int) -> Text:
        """A communicate: time since `begin`, an arrow from lifeline to lifeline, and as much of
        what it says as `room` columns hold; of a violation the reason below.
        """
        style = _style(one)
        since = one.t - begin  # below 0 where a verdict came later than that of what followed
        clock = ("+" if since >= 0 else "-") + seconds(abs(since))
        text = Text(no_wrap=True).append(f"{clock:>{TIME}}", "dim")
        arrow = self.columns.arrow(one.sender, one.receiver, one.performative)
        if arrow:
            text.append(f"{'':{self.first - TIME}}{arrow}", style)
        else:
            who, wide = f"{one.bytes} bytes on {one.key}", self.end - TIME - 1
            if one.sender:
                who = f"{one.sender} > {one.receiver} {one.performative}"
            words = _fit(f" {who} ", wide - 1)
            text.append(f" {words:─^{max(0, wide - cell_len(words) + len(words))}}", style)
        beside = " ".join(filter(None, (one.channel, one.text, mark(one))))
        text.append(_fit(f" {beside}", room), style or "italic")
        if one.violation and one.why:
            text.append(f"\n{'':{TIME + 1}}{one.why}", "red")
        return text
