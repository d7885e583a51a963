"""The paper's typed interfaces (section 5.6), made of a design and the classes of its languages."""

from functools import reduce
from operator import or_
from typing import Any

from fipa_codec.interfaces import ClassInterfaceInfo
from fipa_codec.languages import Languages
from topdown.model.design import Design
from topdown.model.errors import NoSuchEntry


def class_named(languages: Languages, name: str) -> type:
    """The class written as LANGUAGE.Class in a design. Raises NoSuchEntry, or LocalProtocolError for the language."""
    language, _, word = name.partition(".")
    classes = {kind.__name__: kind for kind in languages.named(language).classes}
    if word not in classes:
        raise NoSuchEntry(f"class of language {language}", word, sorted(classes))
    return classes[word]


def interface(design: Design, languages: Languages, use: str) -> ClassInterfaceInfo:
    """Return the questions of a use of a protocol: [(performative, name, [argument classes], answer class)]."""
    rows: list[tuple[str, str, list[type], Any]] = []
    for entry in design.entries(use):
        answers = [class_named(languages, name) for name in entry.answers]
        arguments = [class_named(languages, name) for name in entry.arguments]
        rows.append((entry.performative, entry.name, arguments, reduce(or_, answers) if answers else None))
    return ClassInterfaceInfo(rows)


def interfaces(design: Design, languages: Languages) -> dict[str, ClassInterfaceInfo]:
    """The interface of every use of a protocol, by its name."""
    return {use: interface(design, languages, use) for use in design.protocols}
