"""Filters of communicates: by channel, agent, protocol, performative. For tools that show, record
or replay them.

Of one kind any name may fit, of the kinds all must. Pure; must not know where communicates come
from.
"""

from collections.abc import Iterable
from typing import Protocol

import msgspec

from fipa_codec.performatives import Performative
from topdown.model.design import Design


class Filterable(Protocol):
    """The fields a filter reads; records, verdicts and observations have them."""

    @property
    def channel(self) -> str:
        """The channel."""

    @property
    def sender(self) -> str:
        """Return the sender."""

    @property
    def receiver(self) -> str:
        """To whom."""

    @property
    def protocol(self) -> str:
        """Return the use of a protocol that it belongs to."""

    @property
    def performative(self) -> str:
        """The act."""


class UnknownNameError(ValueError):
    """`name` is not a `kind` of the design; `known` are."""

    def __init__(self, kind: str, name: str, known: Iterable[str]) -> None:
        self.kind, self.name, self.known = kind, name, tuple(known)
        super().__init__(f"the design has no {kind} {name!r}; it has {', '.join(self.known)}")


class Filter(msgspec.Struct, frozen=True, omit_defaults=True):
    """Wanted values of each field; (): any. `agents`: as sender or receiver."""

    channels: tuple[str, ...] = ()
    agents: tuple[str, ...] = ()
    protocols: tuple[str, ...] = ()
    performatives: tuple[str, ...] = ()

    def __bool__(self) -> bool:
        """Whether anything is left out."""
        return self != Filter()

    def keeps(self, one: Filterable) -> bool:
        """Whether it is meant."""
        return (
            (not self.channels or one.channel in self.channels)
            and (not self.agents or one.sender in self.agents or one.receiver in self.agents)
            and (not self.protocols or one.protocol in self.protocols)
            and (not self.performatives or one.performative in self.performatives)
        )


def checked(wanted: Filter, design: Design) -> Filter:
    """The same filter. Raises UnknownNameError for a name that nothing of the design can have."""
    known = {
        "channel": (wanted.channels, sorted({use.channel for use in design.file.protocol})),
        "agent": (wanted.agents, list(design.agents)),
        "protocol": (wanted.protocols, sorted({use.follows for use in design.file.protocol})),
        "performative": (wanted.performatives, sorted(map(str, Performative))),
    }
    for kind, (names, there) in known.items():
        for name in names:
            if name not in there:
                raise UnknownNameError(kind, name, there)
    return wanted
