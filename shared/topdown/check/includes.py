"""Included systems: their designs can be read, in no circle; agents and guests are there; names and
languages mean the same in both designs.
"""

from collections.abc import Iterable, Iterator

from topdown.model import elements
from topdown.model.design import Design, Included
from topdown.model.findings import Finding, Kind
from topdown.model.loading import Path_


def findings(design: Design) -> Iterator[Finding]:
    """Of every include. What is wrong within an included design, its own check finds."""
    file = design.file
    taken = {
        **dict.fromkeys(design.agents, "an agent"),
        **dict.fromkeys((group.name for group in file.group), "a group"),
        **dict.fromkeys(design.guests, "a guest"),
        **dict.fromkeys(file.system.recorders, "a recorder"),
    }
    for number, entry in enumerate(file.include):
        where, at = f"include {entry.name}", ("include", number)
        if entry.name in taken:
            wrong = f"is the name of {taken[entry.name]}"
            yield Finding(Kind.TWICE, where, wrong, "give it another name", (*at, "name"))
        one = design.included[entry.name]
        if one.design is None:
            yield Finding(Kind.NO_INCLUDE, where, one.wrong, one.right, (*at, "file"))
            continue
        yield from _guests(design, one, where, at)
        yield from _words(design, one.design, where, at)


def _guests(design: Design, one: Included, where: str, at: Path_) -> Iterator[Finding]:
    there = one.design
    assert there is not None
    agents: set[str] = set()
    guests: set[str] = set()
    for number, link in enumerate(one.entry.guest):
        here = (*at, "guest", number)
        known = (
            ("agent", link.agent, design.agents, "agent here"),
            ("guest", link.guest, there.guests, f"guest of {there.file.system.name}"),
        )
        missing = [
            Finding(Kind.UNDEFINED, where, f"{kind} {name!r} is not there", _one_of(names), here)
            for _, name, names, kind in known
            if name not in names
        ]
        yield from missing
        for what, name, before in (("agent", link.agent, agents), ("guest", link.guest, guests)):
            if name in before:
                wrong = f"{what} {name} is there already"
                right = "one agent for each guest, and one guest for each agent"
                yield Finding(Kind.TWICE, where, wrong, right, here)
            before.add(name)
        mine = {f"{one.entry.name}.{use.name}" for use in there.uses_of(link.guest)}
        if not missing and mine.isdisjoint(_talked(design.agents[link.agent])):
            wrong = f"no state of {link.agent} talks in a use of guest {link.guest}"
            right = f"name one under `talks`: {', '.join(sorted(mine)) or 'it has none'}"
            yield Finding(Kind.UNUSED, where, wrong, right, here)


def _words(design: Design, there: Design, where: str, at: Path_) -> Iterator[Finding]:
    """Languages and tables of one name in both designs must be the same."""
    uses = [use for use in design.included_uses.values() if use.channel == where.split()[1]]
    theirs = {entry.name: entry.classes for entry in there.file.language}
    for entry in design.file.language:
        spoken = any(entry.name == message.language for use in uses for message in use.message)
        if spoken and entry.classes != theirs.get(entry.name, ()):
            wrong = f"language {entry.name} has other classes there"
            right = "list the same classes, or give the language here another name"
            yield Finding(Kind.TWICE, where, wrong, right, at)
    tables = {entry.name: (entry.initiator, entry.participant) for entry in there.file.table}
    for mine in design.file.table:
        followed = any(use.follows == mine.name for use in uses)
        if followed and (mine.initiator, mine.participant) != tables.get(mine.name):
            wrong = f"table {mine.name} has other rows there"
            right = "write the same rows, or give the table here another name"
            yield Finding(Kind.TWICE, where, wrong, right, at)


def _talked(agent: elements.Agent) -> set[str]:
    return {use for state in agent.state for use in state.talks}


def _one_of(names: Iterable[str]) -> str:
    return f"one of {', '.join(names)}" if names else "there is none"
