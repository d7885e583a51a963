"""`roco traffic echo`: one line for each communicate, as it is judged, live and of a recording."""

import sys
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from datetime import datetime
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import msgspec
from rich.cells import cell_len, set_cell_size
from rich.text import Text

from agent_runtime.core.wiring import parse_life
from agent_runtime.io.tap import Sample
from console import interrupts
from console.errors import UsageError
from console.fleet import targets
from console.output import Form, Format, RunDir, option, tell_json
from console.terminal.console import Console
from console.terminal.sequence import Lifelines, mark
from console.traffic import listen
from console.traffic.listen import Source, about, heard_message, source
from fipa_codec.communicate import Communicate, decode
from operate.filters import Filter
from operate.system import System
from operate.verdict_lines import Judged, line
from operate.wording import bytes_in_words
from topdown.draw import sequence
from topdown.draw.sequence import Arrow
from topdown.judge.judge import Judge
from topdown.judge.verdicts import Judgement, Verdict
from topdown.model.design import Design

ENDLESS = 10_000
"""Columns where nobody's terminal is: a line for each, whole."""
STYLES = {Verdict.LEGAL: "green", Verdict.SLOW: "yellow"}
Echoed = tuple[Judged, Communicate | None]


def echo(
    channel: listen.Channels = None,
    agent: listen.Agents = None,
    protocol: listen.Protocols = None,
    performative: listen.Performatives = None,
    wrong: listen.Wrong = False,
    run: listen.Recorded = None,
    count: listen.Count = 0,
    for_: listen.Seconds = 0.0,
    target: targets.Name = "",
    run_dir: RunDir = None,
    form: Form = Format.TEXT,
) -> None:
    """Print a line for each communicate: time, channel, who to whom, act, protocol, size, content,
    verdict.

    Of a running fleet until Ctrl-C. A verdict that has to wait for what explains it comes up to
    three seconds later; of a conversation that had begun before nothing can be judged. JSON has all
    fields and the whole content, an object a line.

    Examples:
      roco traffic echo
      roco traffic echo --channel CHANNEL --agent AGENT --count 10
      roco traffic echo --target compose --wrong
      roco traffic echo --run runs/latest --performative request --format json
    """
    which = listen.wanted(
        about(run, run_dir, target).design, channel, agent, protocol, performative
    )
    console = Console(highlight=False, quiet=form is Format.JSON)
    width = console.width if console.is_terminal else ENDLESS
    with source(run, run_dir, target) as heard:
        ends = [">".join(one.ends) for one in heard.system.design.channels.values()]
        names = max(map(len, ends), default=0)

        def show(one: Judged) -> None:
            console.print(drawn(one, width, names), soft_wrap=True)

        _told(heard, which, form, show, limits=(count, for_), wrong=wrong)


def _told(
    heard: Source,
    which: Filter,
    form: Form,
    show: Callable[[Judged], None],
    *,
    limits: tuple[int, float],
    wrong: bool,
) -> None:
    """Show what is meant of what is said, as it is judged, until Ctrl-C; for programs as JSON.

    `limits`: how many at most (0: all), and seconds; `wrong`: violations only. How many came faster
    than they could be taken is said on standard error.
    """
    found, (count, seconds) = 0, limits
    try:
        for one, communicate in echoed(heard, seconds):
            if which.keeps(one) and (one.violation or not wrong):
                show(one)
                if form is Format.JSON:
                    tell_json(fields(one, communicate))
                found += 1
                if found == count:
                    break
    except KeyboardInterrupt:
        pass
    finally:
        if lost := heard.lost():
            print(f"roco: {lost.removeprefix('; ')}", file=sys.stderr)


def echoed(heard: Source, seconds: float = 0.0) -> Iterator[Echoed]:
    """Yield each communicate with the judge's verdict; those that wait for their verdict come
    later.
    """
    system, last = heard.system, 0.0
    judge = Judge(system.design, system.languages)
    for sample in heard.samples(seconds):
        last = time.time() if sample is None else sample.at
        yield from (_line(found, system) for found in _judged(judge, sample, last))
    yield from (_line(found, system) for found in judge.finish(last))


def _judged(judge: Judge, sample: Sample | None, at: float) -> Iterable[Judgement]:
    if sample is None:
        return judge.pass_time(at)
    if sample.token:
        agent, chunk = sample.key.split("/")[-2:]
        found = None if sample.gone else parse_life(chunk)
        return judge.lived(agent, found[0], at, journal=found[1]) if found is not None else ()
    if heard_message(sample) is None:
        return judge.pass_time(at)
    if sample.broken:
        return judge.noted(sample.key, sample.broken, at)
    if sample.size:
        return judge.hear(sample.key, decode(sample.data), at, sample.size, (None, None))
    return judge.hear(sample.key, sample.data, at)


def _line(judgement: Judgement, system: System) -> Echoed:
    return line(judgement, system), judgement.heard.communicate


def fields(one: Judged, communicate: Communicate | None) -> dict[str, Any]:
    """The line for programs: the verdict's and the communicate's fields, absent where they are
    empty.
    """
    told = msgspec.to_builtins(one)
    if communicate is not None:
        for name in ("ontology", "reply_by", "reply_with", "in_reply_to", "sent"):
            told[name] = getattr(communicate, name)
        if communicate.content is not msgspec.UNSET:
            told["content"] = msgspec.msgpack.decode(communicate.content)
    return {name: value for name, value in told.items() if value not in ("", None)}


def drawn(one: Judged, width: int, names: int) -> Text:
    """The line for people, no wider than `width` but for the reason of a violation, which stands
    below.

    `names`: columns of who speaks to whom.
    """
    style = "bold red" if one.violation else STYLES.get(Verdict(one.verdict), "dim")
    clock = datetime.fromtimestamp(one.t).strftime("%H:%M:%S.%f")[:-3]
    who = f"{one.sender}>{one.receiver}" if one.sender else "?"
    text = Text(no_wrap=True)
    text.append(f"{clock} ", "dim").append(f"{one.channel:2} ").append(f"{who:{names}} ", "bold")
    text.append(f"{one.performative:11} ", "cyan").append(f"{one.protocol:10} ", "dim")
    text.append(f"{bytes_in_words(one.bytes):>7}  ")
    room = width - cell_len(text.plain) - len(one.verdict) - 1
    words = one.text or one.key
    if width == ENDLESS:
        words = f"{words:34}"
    else:
        words = words if cell_len(words) <= room else words[: max(0, room - 1)] + "…"
        words = set_cell_size(words, max(0, room))
    text.append(words, "italic").append(f" {one.verdict}", style)
    if one.violation and one.why:
        text.append(f"\n{'':13}{one.why}", "red")
    return text


# --- `roco sniff`: a sequence diagram of what is said, with a lifeline for every agent, as it goes
# by or of a recording.


HEADING_EACH = 30
"""Lines after which a terminal shows the names again: about a screen (estimate)."""
MOST_ARROWS = 1000
"""Arrows in a drawing: the newest. One with more is taller than viewers show (estimate)."""


class Sniffed:
    """The diagram so far: printed line by line, the newest kept for the drawing."""

    def __init__(self, agents: list[str], console: Console) -> None:
        self.agents, self.console = agents, console
        self.lives = Lifelines(agents, console.width)
        # numbered: one step, whenever Ctrl-C comes
        self._kept: deque[tuple[int, Judged]] = deque(maxlen=MOST_ARROWS)
        self._begin = 0.0
        if console.is_terminal:
            console.print(self.lives.heading(), soft_wrap=True)

    @property
    def count(self) -> int:
        """Number of communicates."""
        return self._kept[-1][0] if self._kept else 0

    def add(self, one: Judged, *, draw: bool) -> None:
        """Take a communicate; `draw`: print it."""
        before = self.count
        self._begin = self._begin if before else one.t
        self._kept.append((before + 1, one))
        if not draw:
            return
        terminal = self.console.is_terminal
        if (before and before % HEADING_EACH == 0) if terminal else not before:
            self.console.print(self.lives.heading(), soft_wrap=True)
        room = self.lives.room if terminal else ENDLESS
        self.console.print(self.lives.row(one, self._begin, room), soft_wrap=True)

    def svg(self, title: str) -> str:
        """Return the drawing of what is kept."""
        # By time: a verdict may have come later than those of what followed.
        kept = sorted((one for _, one in self._kept), key=lambda one: one.t)
        return sequence.draw(sequence.Diagram(title, tuple(self.agents), tuple(arrows(kept)))).svg()


def sniff(
    channel: listen.Channels = None,
    agent: listen.Agents = None,
    protocol: listen.Protocols = None,
    performative: listen.Performatives = None,
    wrong: listen.Wrong = False,
    svg: Annotated[Path | None, option("Write the diagram here at the end.", "--svg")] = None,
    run: listen.Recorded = None,
    count: listen.Count = 0,
    for_: listen.Seconds = 0.0,
    target: targets.Name = "",
    run_dir: RunDir = None,
    form: Form = Format.TEXT,
) -> None:
    """Draw a live sequence diagram of the traffic, with a lifeline for each agent.

    Of a running fleet until Ctrl-C; of a recording with --run. With a filter the lifelines are
    those of agents that may say or hear what is meant. Beside an arrow stand channel, content and,
    if it is not legal, the verdict; the drawing of --svg has the newest 1000 arrows. JSON is that
    of `roco traffic echo`. Of one conversation, with the states of its roles: `roco conversation`.

    Examples:
      roco sniff
      roco sniff --agent AGENT --for 30 --svg talk.svg
      roco sniff --run runs/latest --channel CHANNEL
    """
    with interrupts.heard():
        if svg is not None and not svg.resolve().parent.is_dir():
            raise UsageError(f"{svg.parent} is not a folder; make it, or name another --svg")
        design = about(run, run_dir, target).design
        which = listen.wanted(design, channel, agent, protocol, performative)
        console = Console(highlight=False, quiet=form is Format.JSON)
        seen = Sniffed(speakers(design, which), console)
        show = partial(seen.add, draw=form is Format.TEXT)
        with source(run, run_dir, target) as heard:
            _told(heard, which, form, show, limits=(count, for_), wrong=wrong)
        if svg is not None:
            svg.write_text(
                seen.svg(f"what was said in {design.file.system.name}"), encoding="utf-8"
            )
            console.print(
                f"wrote {svg}: {min(MOST_ARROWS, seen.count)} of {seen.count} arrows",
                soft_wrap=True,
            )


def speakers(design: Design, which: Filter) -> list[str]:
    """Return the agents that may say or hear what is meant, in the order of the design; without a
    filter all.
    """
    rules = [rule for rule in design.rules.values() if which.keeps(rule)]
    named = {name for rule in rules for name in (rule.sender, rule.receiver)}
    return [name for name in design.agents if name in named or not which]


def arrows(kept: Sequence[Judged]) -> list[Arrow]:
    """Return communicates as arrows of a drawing; times since the first of them."""
    begin = kept[0].t if kept else 0.0
    return [
        Arrow(
            at=one.t - begin,
            sender=one.sender or "?",
            receiver=one.receiver or one.key,
            label=one.performative or f"{one.bytes} bytes",
            detail=" ".join(filter(None, (one.channel, bytes_in_words(one.bytes), one.text))),
            alert=": ".join(filter(None, (mark(one), one.why if one.violation else ""))),
        )
        for one in kept
    ]
