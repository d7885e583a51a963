"""Is a design consistent in itself? Typed findings, none where all is well; topdown.agreement compares it with code.
No I/O.
"""

from collections import Counter
from collections.abc import Iterator, Mapping

from fipa_codec.performatives import Performative
from topdown import elements
from topdown.design import Design
from topdown.findings import Finding, Kind


def check(design: Design) -> tuple[Finding, ...]:
    """All findings of the file itself, none where it is consistent."""
    names = tuple(_twice(design))
    if names:
        return names
    parts = (_requirements, _decomposition, _channels, _protocols, _messages, _interfaces, _machines, _houses)
    return tuple(finding for part in parts for finding in part(design))


def _twice(design: Design) -> Iterator[Finding]:
    """Names that two entries of the same kind have."""
    file = design.file
    groups: dict[str, list[str]] = {
        "requirement": [entry.id for entry in file.requirement],
        "language": [entry.name for entry in file.language],
        "ontology": [entry.name for entry in file.ontology],
        "interface": [entry.name for entry in file.interface],
        "protocol": [entry.name for entry in file.protocol],
        "agent": [entry.name for entry in file.agent],
        "house": [entry.kind for entry in file.house],
        "step, channel": [channel.id for step in file.step for channel in step.channels],
    }
    groups |= {f"agent {agent.name}, state": [state.name for state in agent.state] for agent in file.agent}
    groups |= {f"interface {entry.name}, entry": [e.name for e in entry.entries] for entry in file.interface}
    for kind, names in groups.items():
        for name, count in Counter(names).items():
            if count > 1:
                yield Finding(Kind.TWICE, f"{kind} {name}", f"is defined {count} times", "every name once")


def _requirements(design: Design) -> Iterator[Finding]:
    known = {entry.id: entry.parent for entry in design.file.requirement}
    for name, parent in known.items():
        if parent and parent not in known:
            yield Finding(
                Kind.REQUIREMENT,
                f"requirement {name}",
                f"its parent {parent!r} is not there",
                f"one of {', '.join(known)}",
            )
        elif _circular(name, known):
            yield Finding(Kind.REQUIREMENT, f"requirement {name}", "is its own ancestor", "requirements form a tree")
    taken = [name for step in design.file.step for name in step.requirements]
    for name in taken:
        if name not in known:
            yield Finding(Kind.REQUIREMENT, "steps", f"requirement {name!r} is not there", f"one of {', '.join(known)}")
    for name in known:
        if name not in taken:
            yield Finding(
                Kind.REQUIREMENT, f"requirement {name}", "no step handles it", "the method stops when all are processed"
            )


def _circular(name: str, parents: Mapping[str, str]) -> bool:
    seen = {name}
    while (name := parents.get(name, "")) and name not in seen:
        seen.add(name)
    return bool(name)


def _decomposition(design: Design) -> Iterator[Finding]:
    result = design.decomposition
    for slip in result.slips:
        yield Finding(Kind.DECOMPOSITION, f"step {slip.step}", slip.wrong, slip.right)
    for group in result.last.groups:
        if group not in design.agents:
            yield Finding(
                Kind.DECOMPOSITION, f"group {group}", "is divided no further and is no agent", "give it an agent entry"
            )
    for agent in design.agents:
        if agent not in result.last.groups:
            yield Finding(
                Kind.DECOMPOSITION,
                f"agent {agent}",
                "no step ends in this group",
                f"groups are {', '.join(result.last.groups)}",
            )
    for step, entry in enumerate(design.file.step, start=1):
        for half in entry.divide.into if entry.divide else ():
            if half not in {task.group for task in entry.tasks}:
                yield Finding(
                    Kind.DECOMPOSITION,
                    f"step {step}",
                    f"group {half} has no task",
                    "each half has clear, coherent tasks",
                )


def _channels(design: Design) -> Iterator[Finding]:
    used = {use.channel for use in design.file.protocol}
    pairs = Counter(frozenset(channel.ends) for channel in design.channels.values())
    for channel in design.channels.values():
        if channel.id not in used:
            yield Finding(Kind.CHANNEL, f"channel {channel.id}", "carries no protocol", "give it one")
        if pairs[frozenset(channel.ends)] > 1:
            yield Finding(
                Kind.CHANNEL,
                f"channel {channel.id}",
                "joins two agents that have another channel",
                "one channel for each pair",
            )


def _protocols(design: Design) -> Iterator[Finding]:
    ontologies = {entry.name for entry in design.file.ontology}
    seen: set[tuple[str, str, str]] = set()
    for use in design.file.protocol:
        where = f"protocol {use.name}"
        channel = design.channels.get(use.channel)
        if channel is None:
            yield Finding(
                Kind.PROTOCOL, where, f"channel {use.channel!r} is not there", f"one of {', '.join(design.channels)}"
            )
        elif {use.initiator, use.participant} != set(channel.ends):
            ends = " and ".join(channel.ends)
            yield Finding(
                Kind.PROTOCOL,
                where,
                f"{use.initiator} and {use.participant} are not the ends of {use.channel}",
                f"they are {ends}",
            )
        if use.ontology and use.ontology not in ontologies:
            yield Finding(
                Kind.PROTOCOL, where, f"ontology {use.ontology!r} is not there", f"one of {', '.join(ontologies)}"
            )
        if (key := (use.initiator, use.participant, use.follows)) in seen:
            yield Finding(
                Kind.TWICE,
                where,
                f"{use.follows} from {use.initiator} to {use.participant} is used already",
                "one use for each",
            )
        seen.add(key)
        for name in use.interface:
            if name not in design.interfaces:
                yield Finding(
                    Kind.PROTOCOL, where, f"interface {name!r} is not there", f"one of {', '.join(design.interfaces)}"
                )


def _messages(design: Design) -> Iterator[Finding]:
    languages = {entry.name for entry in design.file.language}
    for use in design.file.protocol:
        for message in use.message:
            where = f"protocol {use.name}, {message.sender} {message.performative}"
            if message.sender not in (use.initiator, use.participant):
                yield Finding(
                    Kind.PROTOCOL, where, f"{message.sender!r} is no end of it", f"{use.initiator} or {use.participant}"
                )
            if message.language not in languages:
                yield Finding(
                    Kind.LANGUAGE,
                    where,
                    f"language {message.language!r} is not there",
                    f"one of {', '.join(sorted(languages))}",
                )
            for name in message.content:
                if name.startswith("*") and name[1:] not in use.interface:
                    yield Finding(
                        Kind.INTERFACE,
                        where,
                        f"{name} is no interface of the protocol",
                        f"one of {', '.join(use.interface)}",
                    )


def _interfaces(design: Design) -> Iterator[Finding]:
    """Every entry can be asked and answered by the messages of the protocols that have it."""
    offered = {name for use in design.file.protocol for name in use.interface}
    for name in design.interfaces.keys() - offered:
        yield Finding(Kind.INTERFACE, f"interface {name}", "no protocol offers it", "name it in a protocol or drop it")
    for use in design.file.protocol:
        asked, answered = _sayable(design, use)
        for name in (name for name in use.interface if name in design.interfaces):
            for entry in design.interfaces[name].entries:
                where = f"protocol {use.name}, {entry.name}"
                for wanted in entry.arguments or ("",):
                    if (entry.performative, wanted) not in asked:
                        yield Finding(
                            Kind.INTERFACE,
                            where,
                            f"no message {entry.performative} carries {wanted or 'nothing'}",
                            "list it as content",
                        )
                for wanted in entry.answers:
                    if wanted not in answered:
                        yield Finding(
                            Kind.INTERFACE,
                            where,
                            f"no answer of {use.participant} carries {wanted}",
                            "list it as content",
                        )


def _sayable(design: Design, use: elements.Protocol) -> tuple[set[tuple[Performative, str]], set[str]]:
    """(act, class) the initiator may say ("" where it has no content), classes the participant may answer."""
    asked: set[tuple[Performative, str]] = set()
    answered: set[str] = set()
    for message in use.message:
        known = all(not name.startswith("*") or name[1:] in design.interfaces for name in message.content)
        contents = design.contents(use, message) if known else ()
        if message.sender == use.initiator:
            asked |= {(message.performative, name) for name in contents or ("",)}
        else:
            answered |= set(contents)
    return asked, answered


def _machines(design: Design) -> Iterator[Finding]:
    for agent in design.file.agent:
        states = {state.name: state for state in agent.state}
        if agent.initial not in states:
            yield Finding(
                Kind.STATE,
                f"agent {agent.name}",
                f"initial state {agent.initial!r} is not there",
                f"one of {', '.join(states)}",
            )
        for arc in agent.arc:
            for end in (arc.source, arc.target):
                if end not in states:
                    yield Finding(
                        Kind.STATE,
                        f"agent {agent.name}, arc",
                        f"state {end!r} is not there",
                        f"one of {', '.join(states)}",
                    )
        yield from _arcs_of(agent)
        yield from _talks_of(design, agent)


def _arcs_of(agent: elements.Agent) -> Iterator[Finding]:
    """Every state is reachable, and is left whatever holds; no arc stands behind one that is always taken."""
    reached = reachable(agent)
    for state in agent.state:
        where = f"agent {agent.name}, state {state.name}"
        if state.name not in reached:
            yield Finding(
                Kind.STATE, where, "cannot be reached", f"lead an arc to it from {', '.join(sorted(reached))}"
            )
        labels = [arc.when for arc in agent.arc if arc.source == state.name]
        if "" not in labels:
            yield Finding(Kind.STATE, where, "may have no way out", "end its arcs with one that has no condition")
        elif labels.index("") != len(labels) - 1:
            yield Finding(
                Kind.STATE, where, "has arcs behind one that is always taken", "put the arc without a condition last"
            )


def _talks_of(design: Design, agent: elements.Agent) -> Iterator[Finding]:
    """A state talks in protocols of its agent only; every protocol of the agent has a state that does."""
    own = {use.name for use in design.file.protocol if agent.name in (use.initiator, use.participant)}
    talked = {name for state in agent.state for name in state.talks}
    for name in sorted(talked - own):
        yield Finding(
            Kind.STATE,
            f"agent {agent.name}",
            f"a state talks in {name!r}",
            f"its protocols are {', '.join(sorted(own))}",
        )
    for name in sorted(own - talked):
        yield Finding(
            Kind.STATE, f"agent {agent.name}", f"no state talks in {name}", "name it under `talks` of a state"
        )


def reachable(agent: elements.Agent) -> frozenset[str]:
    """States that a chain of arcs leads to from the initial one."""
    found, ahead = {agent.initial}, [agent.initial]
    while ahead:
        here = ahead.pop()
        for arc in agent.arc:
            if arc.source == here and arc.target not in found:
                found.add(arc.target)
                ahead.append(arc.target)
    return frozenset(found)


def _houses(design: Design) -> Iterator[Finding]:
    for house in design.file.house:
        if "{system}" not in house.key or "{owner}" not in house.key:
            yield Finding(
                Kind.CHANNEL,
                f"house {house.kind}",
                f"its key {house.key!r} lacks system or owner",
                "name {system} and {owner} in it",
            )
