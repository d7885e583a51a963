"""Protocols by name: those of this package, and those a system adds."""

from collections.abc import Callable

from fipa_codec.errors import LocalProtocolError
from fipa_codec.tables import Protocol


class _Protocols(dict[str, Protocol]):
    def __missing__(self, name: str) -> Protocol:
        raise LocalProtocolError("protocol", f"{name!r} is unknown, known are {', '.join(sorted(self))}")


_registered = _Protocols()
named: Callable[[str], Protocol] = _registered.__getitem__
"""LocalProtocolError names the protocols there are; one of a system is there once its module is imported."""


def register(protocol: Protocol) -> Protocol:
    """Make a protocol known by its name and aliases, for conversations read from a wire or a journal.

    Names are only ever added: LocalProtocolError where one is already taken by another protocol.
    """
    for name in (protocol.name, *protocol.aliases):
        if _registered.setdefault(name, protocol) is not protocol:
            raise LocalProtocolError("protocol", f"{name!r} is already another protocol")
    return protocol
