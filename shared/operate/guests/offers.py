"""What a design offers a guest, derived from its rows: an offer for each content with which the
guest may open a conversation. Pure.

The schema of the arguments is that of the content's class, without what the design withholds; what
comes in is read by the same class. Must not know: by which protocol programs come in.
"""

import inspect
from collections.abc import Iterable
from typing import Any, NamedTuple

import msgspec

from fipa_codec.languages import Languages
from fipa_codec.performatives import Performative
from topdown.model.design import Design

TAG = "type"
"""The field that names the class; the offer has that already."""


class ArgumentError(ValueError):
    """Arguments that an offer does not take, and what it takes."""


class Offer(NamedTuple):
    """Something a guest may ask for. `schema`: JSON schema of its arguments; `consent`: a person
    must agree first; `question`: it only asks, and nothing is done. `answers`: contents that answer
    it.
    """

    name: str
    text: str
    schema: dict[str, Any]
    use: str
    agent: str
    act: Performative
    content: type[msgspec.Struct]
    consent: bool
    question: bool
    answers: tuple[type[msgspec.Struct], ...] = ()

    def read(self, arguments: dict[str, Any], *, strict: bool = True) -> msgspec.Struct:
        """The content with these arguments. `strict`: numbers are as the schema has them. Raise
        ArgumentError.
        """
        known = self.schema["properties"]
        if strange := sorted(arguments.keys() - known.keys()):
            there = ", ".join(known) or "none"
            raise ArgumentError(f"{self.name} takes no {', '.join(strange)}; it takes {there}")
        try:
            return msgspec.convert(arguments, self.content, strict=strict)
        except msgspec.ValidationError as error:
            raise ArgumentError(f"{self.name}: {error}") from error


def offers(design: Design, languages: Languages, guest: str) -> tuple[Offer, ...]:
    """All offers to a guest, in the order of its rows. A name that two uses have gets that of the
    use before it. Raises KeyError for a guest that the design has not.
    """
    found: dict[str, Offer] = {}
    withheld = design.guests[guest].withheld
    for row in design.guests[guest].use:
        use = design.guest_uses[row.name]
        for name in use.interface:
            for entry in design.interfaces[name].entries:
                answers = tuple(_class(languages, answer) for answer in entry.answers)
                for argument in entry.arguments:
                    content = _class(languages, argument)
                    title = f"{use.name}_{entry.name}" if entry.name in found else entry.name
                    found[title] = Offer(
                        title,
                        inspect.cleandoc(content.__doc__ or entry.name),
                        schema(content, withheld),
                        use.name,
                        use.participant,
                        entry.performative,
                        content,
                        row.consent,
                        entry.performative in (Performative.QUERY_REF, Performative.QUERY_IF),
                        answers,
                    )
    return tuple(found.values())


def reader(offered: Iterable[Offer]) -> Offer | None:
    """The offer that reads sentences: a question with one text, answered by what other offers take.
    None where there is none.
    """
    offered = tuple(offered)
    taken = {one.content for one in offered if not one.question}
    reads = (one for one in offered if one.question and taken & {*one.answers})
    return next((one for one in reads if len(one.schema["required"]) == 1), None)


def _class(languages: Languages, name: str) -> type[msgspec.Struct]:
    language, _, word = name.partition(".")
    found: type[msgspec.Struct]
    (found,) = (kind for kind in languages.named(language).classes if kind.__name__ == word)
    return found


def schema(content: type[msgspec.Struct], withheld: tuple[str, ...]) -> dict[str, Any]:
    """The JSON schema of a content's fields (2020-12), without its tag and what is withheld."""
    _, parts = msgspec.json.schema_components([content], ref_template="#/$defs/{name}")
    whole = parts.pop(content.__name__)
    left = {TAG, *withheld}
    fields = {name: one for name, one in whole["properties"].items() if name not in left}
    found = {
        "type": "object",
        "properties": fields,
        "required": [name for name in whole.get("required", ()) if name not in left],
        "additionalProperties": False,
    }
    return {**found, "$defs": parts} if parts else found
