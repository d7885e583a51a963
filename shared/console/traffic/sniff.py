"""`roco sniff`: a sequence diagram of what is said, with a lifeline for every agent, as it goes by
or of a recording.

JADE's sniffer, in the terminal; what it shows are the lines of `roco traffic echo`, chosen by the
same filters.
"""

from collections import deque
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Annotated

from console import interrupts
from console.errors import UsageError
from console.fleet import targets
from console.output import Form, Format, RunDir, option, problems, tell_json
from console.terminal.console import Console
from console.terminal.sequence import Lifelines, mark
from console.traffic import selection
from console.traffic.echo import ENDLESS, chosen, fields, tell_lost
from console.traffic.listen import Source, about, source
from operate.filters import Filter
from operate.verdict_lines import Judged
from operate.wording import bytes_in_words
from topdown.draw import sequence
from topdown.draw.sequence import Arrow
from topdown.model.design import Design

HEADING_EACH = 30
"""Lines after which a terminal shows the names again: about a screen (estimate)."""
MOST = 1000
"""Arrows in a drawing: the newest. One with more is taller than viewers show (estimate)."""


class Sniffed:
    """The diagram so far: printed line by line, the newest kept for the drawing."""

    def __init__(self, agents: list[str], console: Console) -> None:
        self.agents, self.console = agents, console
        self.lives = Lifelines(agents, console.width)
        # numbered: one step, whenever Ctrl-C comes
        self._kept: deque[tuple[int, Judged]] = deque(maxlen=MOST)
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
    channel: selection.Channels = None,
    agent: selection.Agents = None,
    protocol: selection.Protocols = None,
    performative: selection.Performatives = None,
    wrong: selection.Wrong = False,
    svg: Annotated[Path | None, option("Write the diagram here at the end.", "--svg")] = None,
    run: selection.Recorded = None,
    count: selection.Count = 0,
    for_: selection.Seconds = 0.0,
    target: targets.Name = "",
    run_dir: RunDir = None,
    form: Form = Format.TEXT,
) -> None:
    """Draw a sequence diagram of what is said as it goes by, with a lifeline for every agent.

    Of a running fleet until Ctrl-C; of a recording with --run. With a filter the lifelines are
    those of agents that may say or hear what is meant. Beside an arrow stand channel, content and,
    if it is not legal, the verdict; the drawing of --svg has the newest 1000 arrows. JSON is that
    of `roco traffic echo`. Of one conversation, with the states of its roles: `roco conversation`.

    Examples:
      roco sniff
      roco sniff --agent AGENT --for 30 --svg talk.svg
      roco sniff --run runs/latest --channel CHANNEL
    """
    with problems(form), interrupts.heard():
        if svg is not None and not svg.resolve().parent.is_dir():
            raise UsageError(f"{svg.parent} is not a folder; make it, or name another --svg")
        design = about(run, run_dir, target).design
        which = selection.wanted(design, channel, agent, protocol, performative)
        console = Console(highlight=False, quiet=form is Format.JSON)
        seen = Sniffed(speakers(design, which), console)
        with source(run, run_dir, target) as heard, suppress(KeyboardInterrupt):
            _follow(heard, which, seen, form, limits=(count, for_), wrong=wrong)
        if svg is not None:
            svg.write_text(
                seen.svg(f"what was said in {design.file.system.name}"), encoding="utf-8"
            )
            console.print(
                f"wrote {svg}: {min(MOST, seen.count)} of {seen.count} arrows", soft_wrap=True
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


def _follow(
    heard: Source,
    which: Filter,
    seen: Sniffed,
    form: Form,
    *,
    limits: tuple[int, float],
    wrong: bool,
) -> None:
    try:
        for one, communicate in chosen(
            heard, which, count=limits[0], seconds=limits[1], wrong=wrong
        ):
            seen.add(one, draw=form is Format.TEXT)
            if form is Format.JSON:
                tell_json(fields(one, communicate))
    finally:
        tell_lost(heard)
