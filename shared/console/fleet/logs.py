"""`roco logs`: the logs of all agents as one stream, in the order of time, as they were or while
they grow.
"""

import re
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from datetime import datetime
from typing import Annotated, Any

import msgspec
from rich.text import Text

from agent_runtime.io.cli import Level
from console import completion
from console.errors import UsageError
from console.fleet import targets
from console.fleet.targets import Target
from console.output import Form, Format, RunDir, argument, option, tell_json
from console.terminal.console import Console

LAST = 40
"""Lines shown where nothing says how many: a screen."""
LOOK_S = 0.2
"""Between two looks of --follow; agents write in their pauses, some ms after a step."""
HUES = ("cyan", "green", "magenta", "yellow", "blue")
COLOURS = (*HUES, *(f"bright_{hue}" for hue in HUES[:3]))
MARKS = {Level.WARNING: "yellow", Level.ERROR: "bold red"}
LEVELS = tuple(Level)
_UNITS = {"s": 1.0, "m": 60.0, "h": 3600.0, "d": 86400.0}
_AGO = re.compile(r"(\d+(?:\.\d+)?)([smhd])")
_CLOCKS = ("%H:%M:%S", "%H:%M")

Name = Annotated[str, argument("Only this one's.", complete=targets.processes, metavar="[AGENT]")]


class Line(msgspec.Struct, frozen=True):
    """A line of a log. `t`: unix time [s]; `fields`: what else it says."""

    t: float
    agent: str
    level: Level
    event: str
    fields: dict[str, Any]


def logs(
    name: Name = "",
    follow: Annotated[
        bool, option("Go on with what is written, until Ctrl-C.", "-f", "--follow")
    ] = False,
    level: Annotated[Level, option("Least level shown.")] = Level.INFO,
    since: Annotated[
        str,
        option(
            "From then on: 30s, 5m, 2h ago, or a time: 14:05, 2026-11-23T14:05.",
            complete=completion.times,
        ),
    ] = "",
    lines: Annotated[
        int, option("So many of the last lines; 0: all.", "-n", "--lines", min=0)
    ] = LAST,
    target: targets.Name = "",
    run_dir: RunDir = None,
    form: Form = Format.TEXT,
) -> None:
    """Show the logs of all agents as one stream, in the order of time.

    Files have everything from debug on, whatever the level of the agent's own output is. With
    --since all lines from then on, else the last ones.

    Examples:
      roco logs
      roco logs -f AGENT --level debug
      roco logs --since 5m --level warning
    """
    begin = moment(since, time.time()) if since else 0.0
    written = Written(targets.find(target, run_dir), name)
    shown = [line for line in written.new() if _wanted(line, level, begin)]
    show = _shown(form, written.names)
    show(shown if since or not lines else shown[-lines:])
    try:
        while follow:
            time.sleep(LOOK_S)
            show([line for line in written.new() if _wanted(line, level, begin)])
    except KeyboardInterrupt:
        return


class Written:
    """Log lines of a fleet's agents. Raises UsageError if there is no such agent, or it has no
    log.
    """

    def __init__(self, fleet: Target, name: str = "") -> None:
        self._fleet = fleet
        there = _names(fleet)
        if name and name not in there:
            raise UsageError(
                f"no log of {name!r} in {fleet.where}; there are: {', '.join(there) or 'none'}"
            )
        self.names = there
        self._followed = dict.fromkeys((name,) if name else there, 0)

    def new(self) -> list[Line]:
        """The lines written since the last look, in the order of time; one not whole yet waits."""
        return sorted(
            (line for name in self._followed for line in self._of(name)), key=lambda line: line.t
        )

    def _of(self, name: str) -> Iterator[Line]:
        data = self._unread(name)
        whole = data[: data.rfind(b"\n") + 1]
        self._followed[name] += len(whole)
        yield from parsed(whole.splitlines())

    def _unread(self, name: str) -> bytes:
        """Return the log after the part already read; all of it if the log was restarted and is
        shorter now.
        """
        if read := self._followed[name]:
            if data := self._fleet.logged(name, read - 1):
                return data[1:]
            self._followed[name] = 0
        return self._fleet.logged(name, 0)


def parsed(raw: Iterable[bytes]) -> Iterator[Line]:
    """Lines of a log file; a torn one is left out."""
    for one in raw:
        with suppress(msgspec.DecodeError, KeyError, ValueError):
            told = msgspec.json.decode(one, type=dict[str, Any])
            at, level = float(told.pop("t")), Level(told.pop("level"))
            yield Line(at, told.pop("agent"), level, told.pop("event"), told)


def moment(text: str, now: float) -> float:
    """The unix time [s] that --since names: so long ago, a time of this day, or a date. Raises
    UsageError.
    """
    if found := _AGO.fullmatch(text):
        return now - float(found[1]) * _UNITS[found[2]]
    for form in _CLOCKS:
        try:
            clock = datetime.strptime(text, form).time()
        except ValueError:
            continue
        return datetime.combine(datetime.fromtimestamp(now).date(), clock).timestamp()
    try:
        return datetime.fromisoformat(text).timestamp()
    except ValueError as error:
        write = "write 30s, 5m, 2h, 14:05 or 2026-11-23T14:05"
        raise UsageError(f"--since {text} is not a time; {write}") from error


def worded(line: Line) -> str:
    """The fields of a line in words."""
    return " ".join(
        f"{name}={value}" for name, value in line.fields.items() if value not in ("", None)
    )


def _names(fleet: Target) -> list[str]:
    """The agents of the design first, then who else writes one."""
    found = fleet.logging()
    agents = [name for name in fleet.system.design.agents if name in found]
    return [*agents, *(name for name in found if name not in agents)]


def _wanted(line: Line, level: Level, begin: float) -> bool:
    return line.t >= begin and LEVELS.index(line.level) >= LEVELS.index(level)


def _shown(form: Format, names: list[str]) -> Callable[[list[Line]], None]:
    console, wide = Console(soft_wrap=True, highlight=False), max(map(len, names), default=0)
    colours = {name: COLOURS[index % len(COLOURS)] for index, name in enumerate(names)}

    def show(lines: list[Line]) -> None:
        for line in lines:
            if form is Format.JSON:
                tell_json(line)
            else:
                console.print(_text(line, colours.get(line.agent, ""), wide))

    return show


def _text(line: Line, colour: str, wide: int) -> Text:
    clock = time.strftime("%H:%M:%S", time.localtime(line.t)) + f".{int(line.t % 1 * 1000):03d}"
    mark = MARKS.get(line.level, "dim" if line.level is Level.DEBUG else "")
    event = f"{line.level.value}: {line.event}" if line.level in MARKS else line.event
    head = ((clock, "dim"), " ", (f"{line.agent:<{wide}}", colour), " ")
    return Text.assemble(*head, (event, mark), " ", (worded(line), "dim"))
