"""Interfaces of an agent in the paper's form (section 5.6).

    ClassInterfaceInfo([("request", "generatePlan", [GroundTaskNetwork], HierarchicalPlan)])

The entry has performative, query name, argument classes and answer class. A message with one
argument has it as its content: its class identifies the entry, and the name is not sent.
"""

from collections.abc import Iterable, Iterator, Sequence
from typing import Any, NamedTuple, get_args

from fipa_codec.errors import LocalProtocolError
from fipa_codec.performatives import Performative


class Entry(NamedTuple):
    """One service: `arguments` are the argument classes in order, `answers` the classes of possible
    answers.
    """

    performative: Performative
    name: str
    arguments: tuple[type, ...]
    answers: tuple[type, ...]

    def __str__(self) -> str:
        arguments = ", ".join(c.__name__ for c in self.arguments)
        answers = " | ".join(c.__name__ for c in self.answers) or "nothing"
        return f"{self.performative} {self.name}({arguments}) -> {answers}"


class ClassInterfaceInfo:
    """The services that one side of a channel offers.

    Each entry is (performative, name, [argument classes], answer class). The answer may be a union
    of classes, or None if there is no answer. Raise LocalProtocolError for an unknown performative,
    and for two entries with the same name, or with the same performative and one argument of the
    same class.
    """

    def __init__(self, entries: Iterable[tuple[str, str, Sequence[type], Any]]) -> None:
        self._named: dict[str, Entry] = {}
        by_class: dict[tuple[Performative, type], Entry] = {}
        for performative, name, arguments, answer in entries:
            # of a union, or one
            classes = () if answer is None else tuple(get_args(answer) or (answer,))
            entry = Entry(_performative(performative), name, tuple(arguments), classes)
            if self._named.setdefault(name, entry) is not entry:
                raise LocalProtocolError("interface", f"two entries are named {name!r}")
            if len(entry.arguments) == 1:
                key = (entry.performative, entry.arguments[0])
                if by_class.setdefault(key, entry) is not entry:
                    raise LocalProtocolError(
                        "interface", f"{entry} and {by_class[key]} have the same argument"
                    )

    def __iter__(self) -> Iterator[Entry]:
        return iter(self._named.values())

    def __len__(self) -> int:
        return len(self._named)

    def named(self, name: str) -> Entry:
        """The entry of this name. Raise LocalProtocolError, with the known names, if there is
        none.
        """
        if name not in self._named:
            raise LocalProtocolError(
                "interface", f"{name!r} is unknown, known are {', '.join(sorted(self._named))}"
            )
        return self._named[name]


def _performative(word: str) -> Performative:
    try:
        return Performative(word)
    except ValueError:
        raise LocalProtocolError(
            "performative", f"{word!r} is not one of the 22 acts of SC00037J"
        ) from None
