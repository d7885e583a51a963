"""`roco agents --offers`: who offers which protocol, ontology, language and acts, and who is up.

What FIPA's directory facilitator answers to a search (SC00023, 4.1): descriptions of agents with
their services. Here nobody registers: the design says what each agent offers, the fleet who is up.
"""

from pathlib import Path

import msgspec
import typer
from rich.padding import Padding
from rich.text import Text

from console.errors import NO, ConsoleError
from console.fleet import targets
from console.fleet.targets import Target
from console.output import Format, tell
from console.terminal.console import Console
from fipa_codec.performatives import Performative
from operate.fleet_file import ProcessState
from topdown.model import elements
from topdown.model.design import Design
from topdown.model.errors import NoSuchEntry

UP, DOWN, UNKNOWN = "up", "down", "no fleet"
COLOURS = {UP: "green", DOWN: "red"}


class OfferedAct(msgspec.Struct, frozen=True):
    """An act that agents may be asked for: act, name of the kind, classes of its arguments and of
    its answers.
    """

    performative: Performative
    name: str
    arguments: tuple[str, ...]
    answers: tuple[str, ...]

    def words(self) -> str:
        """Return it as a signature."""
        answers = f" -> {' or '.join(self.answers)}" if self.answers else ""
        return f"{self.performative} {self.name}({', '.join(self.arguments)}){answers}"


class Service(msgspec.Struct, frozen=True):
    """A service of an agent (service-description, SC00023 6.1.2): a use of a protocol in which it
    is the participant.

    `name`: the use in the design; `to`: who may ask for it; `languages`: of all that is said in it.
    """

    name: str
    protocol: str
    ontology: str
    languages: tuple[str, ...]
    channel: str
    to: str
    acts: tuple[OfferedAct, ...]


class Description(msgspec.Struct, frozen=True):
    """An agent (df-agent-description, SC00023 6.1.1): `up`, `down` or `no fleet`; what it offers,
    whom it asks.
    """

    agent: str
    up: str
    state: str
    services: tuple[Service, ...]
    asks: tuple[str, ...]


class Search(msgspec.Struct, frozen=True):
    """Search criteria: all that are given must match (SC00023 4.1.4.4); "" and () match
    anything.
    """

    agents: tuple[str, ...] = ()
    protocol: str = ""
    ontology: str = ""
    language: str = ""

    def fits(self, one: Service) -> bool:
        """Whether a service is looked for."""
        return (
            self.protocol in ("", one.protocol, one.name)
            and self.ontology in ("", one.ontology)
            and (not self.language or self.language in one.languages)
        )


def offered(
    search: Search, target: str, run_dir: Path | None, form: Format, *, up: bool, long: bool
) -> None:
    """Tell who offers what a search looks for; with `up` only those that are up. Raise typer.Exit
    where nobody does.
    """
    design = targets.about(target, run_dir).design
    check(search, design)
    found = describe(design, search, states(running(target, run_dir), design))
    found = [one for one in found if one.up == UP or not up]
    tell(found, form, lambda: show(found, Console(highlight=False), long=long))
    if not found:
        raise typer.Exit(NO)


def running(target: str, run_dir: Path | None) -> Target | None:
    """Return the fleet that is meant; None where none is named and none is there."""
    try:
        return targets.find(target, run_dir)
    except ConsoleError:
        if target or run_dir is not None:
            raise
        return None


def states(fleet: Target | None, design: Design) -> dict[str, tuple[str, str]]:
    """Return of each agent whether it is up, and its state."""
    seen = {one.name: one for one in fleet.look().seen} if fleet is not None else {}
    others = DOWN if any(one.status.pid for one in seen.values()) else UNKNOWN
    found = dict.fromkeys(design.agents, (others, ""))
    for name in design.agents:
        one = seen.get(name)
        if one is not None and one.status.state is ProcessState.READY:
            found[name] = (UP, one.beat.state if one.beat is not None else "")
    return found


def check(search: Search, design: Design) -> None:
    """Raise NoSuchEntry for a name that the design does not have."""
    uses = design.file.protocol
    known = {
        "ontology": (search.ontology, {use.ontology for use in uses} - {""}),
        "language": (search.language, {one.name for one in design.file.language}),
        "protocol": (search.protocol, {name for use in uses for name in (use.follows, use.name)}),
    }
    for agent in search.agents:
        design.agent(agent)
    for kind, (name, there) in known.items():
        if name and name not in there:
            raise NoSuchEntry(kind, name, sorted(there))


def describe(design: Design, search: Search, up: dict[str, tuple[str, str]]) -> list[Description]:
    """Return the agents that fit, in the order of the design, each with the services that fit."""
    found = []
    uses = design.file.protocol
    for agent in search.agents or design.agents:
        offered = [service(design, use) for use in uses if use.participant == agent]
        asked = [use for use in uses if use.initiator == agent]
        asks = tuple(f"{use.participant}: {use.name}" for use in asked)
        services = tuple(filter(search.fits, offered))
        if services or not (search.protocol or search.ontology or search.language):
            found.append(Description(agent, *up[agent], services, asks))
    return found


def service(design: Design, use: elements.Protocol) -> Service:
    """Return a use of a protocol as what its participant offers."""
    said = {message.language: None for message in use.message if message.language}
    about = (use.name, use.follows, use.ontology, tuple(said))
    return Service(*about, use.channel, use.initiator, acts(design, use))


def acts(design: Design, use: elements.Protocol) -> tuple[OfferedAct, ...]:
    """Return what may be asked: the entries of its interface, else what the initiator says with a
    content.
    """
    if use.interface:
        return tuple(
            OfferedAct(one.performative, one.name, one.arguments, one.answers)
            for one in design.entries(use.name)
        )
    asked = [message for message in use.message if message.sender == use.initiator]
    return tuple(
        OfferedAct(one.performative, "", design.contents(use, one), ())
        for one in asked
        if one.content
    )


def show(found: list[Description], console: Console, *, long: bool) -> None:
    """Print each agent, its services below it, acts below those."""

    def indented(text: Text, columns: int) -> None:
        console.print(Padding(text, (0, 0, 0, columns), expand=False))

    for one in found:
        up = (one.up, COLOURS.get(one.up, "dim"))
        state = (f" ({one.state})" if one.state else "", "dim")
        console.print(Text.assemble((one.agent, "bold"), "  ", up, state))
        for offered in one.services:
            indented(heading(offered), 2)
            for line in lines(offered, long=long):
                indented(Text(line, "dim"), 4)
        if one.asks:
            indented(Text(f"asks {', '.join(one.asks)}", "dim"), 2)
    if not found:
        console.print("nobody fits", style="dim")


def heading(one: Service) -> Text:
    """Return a service in a line."""
    text = Text.assemble((one.protocol, "cyan"), f" {one.name} on {one.channel} to {one.to}")
    text.append(f", ontology {one.ontology}" if one.ontology else "")
    many = "s" * (len(one.languages) > 1)
    return text.append(f", language{many} {', '.join(one.languages)}")


def lines(one: Service, *, long: bool) -> list[str]:
    """Return its acts: a line for each performative with the names of its kinds, or `long` one for
    each kind.
    """
    if long:
        return [act.words() for act in one.acts]
    kinds: dict[str, list[str]] = {}
    for act in one.acts:
        kinds.setdefault(act.performative, []).append(act.name or " or ".join(act.arguments))
    return [f"{performative}: {', '.join(names)}" for performative, names in kinds.items()]
