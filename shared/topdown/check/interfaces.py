"""Interfaces and messages agree: every entry can be asked and answered, and what opens a conversation is an entry."""

from collections.abc import Iterator

from fipa_codec.performatives import Performative
from topdown.model import elements
from topdown.model.design import Design
from topdown.model.findings import Finding, Kind
from topdown.model.loading import Path_


def findings(design: Design) -> Iterator[Finding]:
    """Of every use of a protocol that offers an interface."""
    for index, use in enumerate(design.file.protocol):
        at: Path_ = ("protocol", index)
        yield from _stars(use, at)
        entries = [e for name in use.interface if name in design.interfaces for e in design.interfaces[name].entries]
        asked, answered = _sayable(design, use)
        for entry in entries:
            yield from _entry(use, entry, asked, answered, at)
        if entries:
            yield from _not_offered(use, entries, asked, at)


def _stars(use: elements.Protocol, at: Path_) -> Iterator[Finding]:
    for number, message in enumerate(use.message):
        for name in message.content:
            if name.startswith("*") and name[1:] not in use.interface:
                where = f"protocol {use.name}, {message.sender} {message.performative}"
                right = f"one of {', '.join(use.interface)}" if use.interface else "the protocol names no interface"
                place = (*at, "message", number, "content")
                yield Finding(Kind.UNDEFINED, where, f"{name} is not an interface of the protocol", right, place)


def _entry(
    use: elements.Protocol,
    entry: elements.InterfaceEntry,
    asked: set[tuple[Performative, str]],
    answered: set[str],
    at: Path_,
) -> Iterator[Finding]:
    where = f"protocol {use.name}, {entry.name}"
    for wanted in entry.arguments or ("",):
        if (entry.performative, wanted) not in asked:
            wrong = f"no message {entry.performative} carries {wanted or 'nothing'}"
            yield Finding(Kind.NOT_ASKED, where, wrong, "list it as content", at)
    for wanted in entry.answers:
        if wanted not in answered:
            wrong = f"no answer of {use.participant} carries {wanted}"
            yield Finding(Kind.NO_ANSWER, where, wrong, "list it as content", at)


def _not_offered(
    use: elements.Protocol,
    entries: list[elements.InterfaceEntry],
    asked: set[tuple[Performative, str]],
    at: Path_,
) -> Iterator[Finding]:
    """Contents of acts that interfaces are about, which no entry takes."""
    acts = {entry.performative for entry in entries}
    taken = {(entry.performative, name) for entry in entries for name in entry.arguments or ("",)}
    for act, name in sorted(pair for pair in asked - taken if pair[0] in acts):
        wrong = f"{act} carries {name or 'nothing'}, which no interface entry takes"
        right = f"declare it in one of {', '.join(use.interface)}"
        yield Finding(Kind.NOT_OFFERED, f"protocol {use.name}, {use.initiator}", wrong, right, at)


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
