"""Every name once, every name that is used defined, every name that is defined used."""

from collections.abc import Iterable, Iterator
from difflib import get_close_matches
from typing import NamedTuple

from fipa_codec.communicate import is_word
from topdown.model.design import Design
from topdown.model.elements import AGENTS, CHANGES, FORMAT
from topdown.model.findings import Finding, Kind
from topdown.model.loading import Path_


class Named(NamedTuple):
    """A kind of entries: its word, where they stand in the file, their names."""

    word: str
    at: Path_
    names: tuple[str, ...]


def older(design: Design) -> Iterator[Finding]:
    """A file of an older format: what changed since, once for each format."""
    written = design.file.format
    for number, changed in CHANGES.items():
        if number > written:
            wrong = f"the file is of format {written}; since format {number}, {changed}"
            right = f"write `format = {FORMAT}` above [system]"
            yield Finding(Kind.OLD_FORMAT, "format", wrong, right, ("system",))


def twice(design: Design) -> Iterator[Finding]:
    """Names that two entries of the same kind have."""
    for kind in _kinds(design):
        for index, name in enumerate(kind.names):
            if name in kind.names[:index]:
                where = f"{kind.word} {name}"
                count = kind.names.count(name)
                wrong = f"is defined {count} times"
                yield Finding(Kind.TWICE, where, wrong, "every name once", (*kind.at, index))


def _kinds(design: Design) -> Iterator[Named]:
    file = design.file
    yield Named("requirement", ("requirement",), tuple(entry.id for entry in file.requirement))
    for kind in (
        "language",
        "ontology",
        "interface",
        "protocol",
        "table",
        "agent",
        "group",
        "guest",
        "include",
        "never",
    ):
        yield Named(kind, (kind,), tuple(entry.name for entry in getattr(file, kind)))
    yield Named("signal", ("signal",), tuple(entry.kind for entry in file.signal))
    for index, agent in enumerate(file.agent):
        states = tuple(state.name for state in agent.state)
        yield Named(f"agent {agent.name}, state", ("agent", index, "state"), states)
        own = tuple(one.name for one in agent.parameter)
        yield Named(f"agent {agent.name}, parameter", ("agent", index, "parameter"), own)
        ways = tuple(one.name for one in agent.choice)
        yield Named(f"agent {agent.name}, choice", ("agent", index, "choice"), ways)
    for index, entry in enumerate(file.interface):
        names = tuple(one.name for one in entry.entries)
        yield Named(f"interface {entry.name}, entry", ("interface", index, "entries"), names)


def findings(design: Design) -> Iterator[Finding]:
    """Undefined and unused languages, ontologies, content types, interfaces and tables."""
    file = design.file
    uses = [use for use, _ in design.written]
    spoken = {message.language for use in uses for message in use.message}
    offers = [entry for interface in file.interface for entry in interface.entries]
    spoken |= {
        name.partition(".")[0] for entry in offers for name in (*entry.arguments, *entry.answers)
    }
    used = {
        "language": spoken,
        "ontology": {use.ontology for use in uses},
        "interface": {name for use in uses for name in use.interface},
        "table": {use.follows for use in uses},
    }
    for kind, names in used.items():
        for index, entry in enumerate(getattr(file, kind)):
            if entry.name not in names:
                where, right = f"{kind} {entry.name}", "name it in a protocol or drop it"
                yield Finding(Kind.UNUSED, where, "no protocol uses it", right, (kind, index))
    for index, agent in enumerate(file.agent):
        gone_on = {row.then for row in agent.row if row.then}
        strange = gone_on - {choice.name for choice in agent.choice}
        for number, choice in enumerate(agent.choice):
            if choice.name not in gone_on and not strange:
                where, at = f"agent {agent.name}, choice {choice.name}", ("agent", index)
                right = "name it under `then` of a row, or drop it"
                place = (*at, "choice", number)
                yield Finding(Kind.UNUSED, where, "no row goes on with it", right, place)
    yield from _written(design)
    yield from _identities(design)
    yield from _undefined(design)
    yield from _content_types(design)


def _written(design: Design) -> Iterator[Finding]:
    """Names that stand in keys and on the wire are words."""
    file = design.file
    named: list[tuple[str, str, Path_]] = [("system", file.system.name, ("system", "name"))]
    for kind in ("agent", "group", "guest", "protocol", "table", "language", "ontology"):
        entries = enumerate(getattr(file, kind))
        named += [(kind, entry.name, (kind, index, "name")) for index, entry in entries]
    for index, step in enumerate(file.step):
        made = [one.id for one in step.channels] + [one for two in step.split for one in two.into]
        named += [("channel", name, ("step", index)) for name in made]
    for kind, name, at in named:
        if not is_word(name):
            where, wrong = f"{kind} {name}", f"{name!r} cannot stand in keys and messages"
            right = "begin with a letter, and write letters, digits and _ . @ - only, 64 at most"
            yield Finding(Kind.BAD_NAME, where, wrong, right, at)


def _identities(design: Design) -> Iterator[Finding]:
    """Recorders say nothing, so none is an agent; a writer or reader of a signal that is nearly the
    name of an agent is a misspelt one.
    """
    said: dict[str, str] = {}
    for kind in ("agent", "group"):
        said |= {entry.name: kind for entry in getattr(design.file, kind)}
    for name in design.file.system.recorders:
        if name in said:
            wrong = f"recorder {name} has the name of the {said[name]} {name}"
            right = "name identities that only hear"
            yield Finding(Kind.TWICE, "system", wrong, right, ("system", "recorders"))
    known = {AGENTS, *said, *design.guests, *design.file.system.recorders}
    for index, entry in enumerate(design.file.signal):
        for field, names in (("writers", entry.writers), ("readers", entry.readers)):
            for name in names:
                near = get_close_matches(name, known, 1, NEAR) if name not in known else []
                if near:
                    where = f"signal {entry.kind}, {field}"
                    wrong = f"{name!r} is nobody of the design, and nearly {near[0]!r}"
                    right = f"write {near[0]!r}, or name a recorder that is not so like it"
                    place: Path_ = ("signal", index, field)
                    yield Finding(Kind.UNDEFINED, where, wrong, right, place)


NEAR = 0.8
"""Likeness of two names of which one is probably the other, misspelt (estimate)."""


def _undefined(design: Design) -> Iterator[Finding]:
    """Ontologies and interfaces of protocols, languages of messages, that no entry defines."""
    ontologies = [entry.name for entry in design.file.ontology]
    languages = [entry.name for entry in design.file.language]
    for use, at in design.written:
        where = f"protocol {use.name}"
        if use.ontology and use.ontology not in ontologies:
            yield _missing("ontology", use.ontology, ontologies, where, (*at, "ontology"))
        for name in use.interface:
            if name not in design.interfaces:
                yield _missing("interface", name, design.interfaces, where, (*at, "interface"))
        for number, message in enumerate(use.message):
            if message.language not in languages:
                said = f"{where}, {message.sender} {message.performative}"
                place: Path_ = (*at, "message", number, "language")
                yield _missing("language", message.language, languages, said, place)
    for index, interface in enumerate(design.file.interface):
        for row, entry in enumerate(interface.entries):
            for name in (*entry.arguments, *entry.answers):
                if name.partition(".")[0] not in languages:
                    said = f"interface {interface.name}, {entry.name}"
                    place = ("interface", index, "entries", row)
                    yield _missing("language", name.partition(".")[0], languages, said, place)


def _missing(kind: str, name: str, known: Iterable[str], where: str, at: Path_) -> Finding:
    right = (
        f"one of {', '.join(sorted(known))}" if known else f"the design has no {kind}: define it"
    )
    return Finding(Kind.UNDEFINED, where, f"{kind} {name!r} is not there", right, at)


def _content_types(design: Design) -> Iterator[Finding]:
    """Classes of languages that list them: said but not listed, listed but never said."""
    listed = {entry.name: entry.classes for entry in design.file.language if entry.classes}
    said: set[str] = set()
    for where, name, at in _classes_said(design):
        language, _, word = name.partition(".")
        said.add(name)
        if language in listed and word not in listed[language]:
            right = f"its classes are {', '.join(listed[language])}"
            wrong = f"language {language} has no content type {word!r}"
            yield Finding(Kind.UNDEFINED, where, wrong, right, at)
    for index, entry in enumerate(design.file.language):
        for word in entry.classes:
            if f"{entry.name}.{word}" not in said:
                right = "list it as content or drop it"
                where = f"language {entry.name}"
                wrong = f"no message carries {word}"
                yield Finding(Kind.UNUSED, where, wrong, right, ("language", index, "classes"))


def _classes_said(design: Design) -> Iterator[tuple[str, str, Path_]]:
    """(where, LANGUAGE.Class, path) of every class that a message or an interface entry names."""
    for use, place in design.written:
        for number, message in enumerate(use.message):
            for name in (name for name in message.content if not name.startswith("*")):
                where = f"protocol {use.name}, {message.sender} {message.performative}"
                at: Path_ = (*place, "message", number, "content")
                yield where, f"{message.language}.{name}", at
    for index, interface in enumerate(design.file.interface):
        for row, entry in enumerate(interface.entries):
            for name in (*entry.arguments, *entry.answers):
                at = ("interface", index, "entries", row)
                yield f"interface {interface.name}, {entry.name}", name, at
