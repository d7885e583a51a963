"""`roco conversation`: list the conversations of a run, and show one as a sequence diagram in the
terminal.
"""

from collections import defaultdict
from typing import Annotated

import msgspec
from rich.table import Table
from rich.text import Text

from console.errors import ConsoleError
from console.fleet import targets
from console.output import Form, Format, RunDir, option, problems, tell_json
from console.terminal import sequence
from console.terminal import table as tables
from console.terminal.console import Console
from console.traffic import selection
from console.traffic.listen import about
from operate.tracing.trace import is_meant
from operate.verdict_lines import Judged, ended, sides
from topdown.judge.verdicts import Verdict
from topdown.model.design import Design


class Conversation(msgspec.Struct, frozen=True):
    """A conversation: who opened it with whom, where it stands, all that was said in it; times in
    unix seconds.
    """

    id: str
    channel: str
    protocol: str
    initiator: str
    participant: str
    since: float
    until: float
    ended: bool
    states: tuple[str, str]
    violations: int
    said: tuple[Judged, ...]


def conversation(
    subject: selection.Subject = "",
    channel: selection.Channels = None,
    agent: selection.Agents = None,
    protocol: selection.Protocols = None,
    performative: selection.Performatives = None,
    open_: Annotated[
        bool | None, option("Only those that go on, or that ended.", "--open/--ended")
    ] = None,
    wrong: Annotated[
        bool, option("Only those with something against the design.", "--wrong")
    ] = False,
    run: selection.Recorded = None,
    target: targets.Name = "",
    run_dir: RunDir = None,
    form: Form = Format.TEXT,
) -> None:
    """List the conversations of a run, oldest first; show one as a sequence diagram.

    Of a running fleet so far, as its monitor judged them; of a recording as they are judged now. A
    conversation is listed if any of its messages matches. The diagram of one has what was said
    when, the states after it, and what the judge says.

    Examples:
      roco conversation --open
      roco conversation --channel CHANNEL --performative failure
      roco conversation --run recording.mcap --format json
      roco conversation AGENT-1-1
      roco conversation AGENT-1-3 --run recording.mcap --format json
    """
    with problems(form):
        design = about(run, run_dir, target).design
        which = selection.wanted(design, channel, agent, protocol, performative)
        kept = [
            one
            for one in conversations(selection.lines_of(run, target, run_dir), design)
            if any(map(which.keeps, one.said))
            and open_ in (None, not one.ended)
            and (one.violations or not wrong)
            and (not subject or is_meant(subject, one.id, one.participant))
        ]
        if subject and not kept:
            raise ConsoleError(
                f"no conversation {subject!r} in this run; `roco conversation` lists them"
            )
        if form is Format.JSON:
            tell_json(kept if subject else [msgspec.structs.replace(one, said=()) for one in kept])
            return
        console = Console()
        if subject:
            for one in kept:
                between = (one.initiator, one.participant)
                console.print(sequence.heading(one.channel, one.protocol, one.id, one.ended))
                console.print(sequence.drawn(one.said, *between, console.width))
        else:
            console.print(table(kept))
            console.print(f"{len(kept)} conversation{'s' * (len(kept) != 1)}", style="dim")


def conversations(lines: list[Judged], design: Design) -> list[Conversation]:
    """Return the traffic by conversation and pair of agents, oldest first."""
    grouped: defaultdict[tuple[str, str, frozenset[str]], list[Judged]] = defaultdict(list)
    for one in lines:
        if one.sender and one.verdict != Verdict.NOT_ENTITLED:
            both = frozenset((one.sender, one.receiver))
            grouped[one.conversation, one.protocol, both].append(one)
    return sorted((_made(said, design) for said in grouped.values()), key=lambda one: one.since)


def table(found: list[Conversation]) -> Table:
    """One line for each."""
    heads = ["conversation", "on", "protocol", "between", "said", "took", "states"]
    heads += ["wrong"] if any(one.violations for one in found) else []
    drawn = tables.table(heads, right=("said", "took", "wrong"))
    for one in found:
        states = " / ".join(dict.fromkeys(filter(None, one.states)))
        between, took = f"{one.initiator} > {one.participant}", one.until - one.since
        row = (one.id, one.channel, one.protocol, between, str(len(one.said)))
        state = Text(states, "dim" if one.ended else "cyan")
        wrong = Text(str(one.violations or ""), "red")
        drawn.add_row(*(*row, sequence.seconds(took), state, wrong)[: len(heads)])
    return drawn


def _made(said: list[Judged], design: Design) -> Conversation:
    first = said[0]
    initiator, participant = sides(design, first.protocol, first.sender, first.receiver)
    told = ((one.initiator, one.participant) for one in reversed(said) if one.initiator)
    states = next(told, ("", ""))
    return Conversation(
        id=first.conversation,
        channel=first.channel,
        protocol=first.protocol,
        initiator=initiator,
        participant=participant,
        since=first.t,
        until=said[-1].t,
        ended=ended(design, first.protocol, states),
        states=states,
        violations=sum(one.violation for one in said),
        said=tuple(said),
    )
