"""The paper's typed interfaces (section 5.6), made of a design and the classes of its languages."""

from difflib import get_close_matches
from functools import reduce
from operator import or_
from typing import Any

from fipa_codec.interfaces import ClassInterfaceInfo
from fipa_codec.languages import Languages
from topdown.model.design import Design
from topdown.model.elements import InterfaceEntry
from topdown.model.errors import DesignError, NoSuchEntry
from topdown.model.loading import line_of


def class_named(languages: Languages, name: str) -> type:
    """The class written as LANGUAGE.Class in a design. Raises NoSuchEntry, or LocalProtocolError
    for the language.
    """
    language, _, word = name.partition(".")
    classes = {kind.__name__: kind for kind in languages.named(language).classes}
    if word not in classes:
        raise NoSuchEntry(f"class of language {language}", word, sorted(classes))
    return classes[word]


def interface(design: Design, languages: Languages, use: str) -> ClassInterfaceInfo:
    """The questions of a use of a protocol: [(performative, name, [argument classes], answer
    class)].

    Raises DesignError for an entry with a class that its language does not have.
    """
    rows: list[tuple[str, str, list[type], Any]] = []
    for entry in design.entries(use):
        try:
            answers = [class_named(languages, name) for name in entry.answers]
            arguments = [class_named(languages, name) for name in entry.arguments]
        except NoSuchEntry as error:
            raise _unfit(design, entry, error) from error
        rows.append(
            (entry.performative, entry.name, arguments, reduce(or_, answers) if answers else None)
        )
    return ClassInterfaceInfo(rows)


def _unfit(design: Design, entry: InterfaceEntry, error: NoSuchEntry) -> DesignError:
    places = (
        (number, row)
        for number, one in enumerate(design.file.interface)
        for row in range(len(one.entries))
    )
    number, row = next(
        (n, row) for n, row in places if design.file.interface[n].entries[row] is entry
    )
    near = get_close_matches(error.name, error.known) or error.known
    return DesignError(
        str(design.place),
        line_of(design.text, ("interface", number, "entries", row)),
        f"interface {design.file.interface[number].name}, {entry.name}",
        f"there is no {error.kind} {error.name!r}",
        f"it has {', '.join(near)}; a new class stands in the union of its language",
    )


def interfaces(design: Design, languages: Languages) -> dict[str, ClassInterfaceInfo]:
    """The interface of every use of a protocol, by its name."""
    return {use: interface(design, languages, use) for use in design.protocols}
