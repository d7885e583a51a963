"""Does a design agree with the code that carries it out: languages' classes, protocols' rows, kinds of queries?

The paper's specification "lets one check that every query kind is supported and that arguments and answers comply"
(section 5.6). The code's side comes in as arguments, so nothing of a particular system is imported here.
"""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping

from fipa_codec.tables import Protocol, Role, Way
from topdown import elements
from topdown.design import Design
from topdown.findings import Finding, Kind


def check_languages(design: Design, classes: Mapping[str, Iterable[str]]) -> tuple[Finding, ...]:
    """Findings between the design and the languages: name -> names of its classes."""
    known = {name: frozenset(found) for name, found in classes.items()}
    declared = frozenset(language.name for language in design.file.language)
    return (
        *_compare_names(declared, frozenset(known)),
        *_interface_classes(design, known),
        *_message_classes(design, known),
    )


def check_protocols(design: Design, tables: Mapping[str, Protocol]) -> tuple[Finding, ...]:
    """Findings between the messages of the design and the rows of the protocols they follow (by name)."""
    return tuple(finding for use in design.file.protocol for finding in _follows(use, tables.get(use.follows)))


def _follows(use: elements.Protocol, protocol: Protocol | None) -> Iterator[Finding]:
    if protocol is None:
        yield Finding(Kind.PROTOCOL, f"protocol {use.name}", f"{use.follows!r} has no table", "follow one that has")
        return
    for agent, role in ((use.initiator, Role.INITIATOR), (use.participant, Role.PARTICIPANT)):
        said = {message.performative for message in use.message if message.sender == agent}
        sayable = {row.performative for row in protocol.tables[role] if row.way is Way.SEND}
        for act in sorted(said - sayable):
            right = f"its rows are {', '.join(sorted(sayable))}"
            yield Finding(Kind.PROTOCOL, f"protocol {use.name}, {agent}", f"{use.follows} has no row for {act}", right)
        if role is Role.INITIATOR and not said & protocol.openings:
            right = f"list one of {', '.join(sorted(protocol.openings))}"
            yield Finding(Kind.PROTOCOL, f"protocol {use.name}", "no message opens it", right)


def check_queries(
    design: Design, interfaces: Iterable[str], language: str, kinds: Iterable[str]
) -> tuple[Finding, ...]:
    """Findings between the argument classes of interface sets and the query classes a language has: neither may lack
    one.
    """
    declared = Counter(
        argument for name in interfaces for entry in design.interfaces[name].entries for argument in entry.arguments
    )
    wanted = frozenset(f"{language}.{kind}" for kind in kinds)
    missing = sorted(wanted - declared.keys())
    foreign = sorted(declared.keys() - wanted)
    double = sorted(name for name, count in declared.items() if count > 1)
    return (
        *(
            Finding(Kind.INTERFACE, name, "no interface entry asks it", "declare it in an interface of the design")
            for name in missing
        ),
        *(
            Finding(Kind.INTERFACE, name, f"{language} has no such query class", "define the class or drop the entry")
            for name in foreign
        ),
        *(
            Finding(Kind.TWICE, name, "several interface entries ask it", "one entry for each query class")
            for name in double
        ),
    )


def _compare_names(declared: frozenset[str], known: frozenset[str]) -> Iterator[Finding]:
    for name in sorted(declared - known):
        yield Finding(
            Kind.LANGUAGE, f"language {name}", "has no module", f"languages with one are {', '.join(sorted(known))}"
        )
    for name in sorted(known - declared):
        yield Finding(
            Kind.LANGUAGE, f"language {name}", "is not in the design", f"the design has {', '.join(sorted(declared))}"
        )


def _interface_classes(design: Design, known: Mapping[str, frozenset[str]]) -> Iterator[Finding]:
    for interface in design.file.interface:
        for entry in interface.entries:
            for name in (*entry.arguments, *entry.answers):
                yield from _class(f"interface {interface.name}, {entry.name}", name, known)


def _message_classes(design: Design, known: Mapping[str, frozenset[str]]) -> Iterator[Finding]:
    for use in design.file.protocol:
        for message in use.message:
            for name in (name for name in message.content if not name.startswith("*")):
                yield from _class(
                    f"protocol {use.name}, {message.sender} {message.performative}", f"{message.language}.{name}", known
                )


def _class(where: str, name: str, known: Mapping[str, frozenset[str]]) -> Iterator[Finding]:
    language, _, word = name.partition(".")
    if word not in known.get(language, frozenset()):
        ways = ", ".join(sorted(known.get(language, frozenset()))) or f"no language {language!r}"
        yield Finding(Kind.LANGUAGE, where, f"{language!r} has no class {word!r}", f"its classes are {ways}")
