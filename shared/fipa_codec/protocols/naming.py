"""Protocols by name: those of this package, and those a system adds."""

from fipa_codec.errors import LocalProtocolError
from fipa_codec.tables import Protocol

_registered: dict[str, Protocol] = {}


def register(protocol: Protocol) -> Protocol:
    """Make a protocol known by its name and aliases, for conversations read from a wire or a journal.

    Names are only ever added: LocalProtocolError where one is already taken by another protocol.
    """
    for name in (protocol.name, *protocol.aliases):
        if _registered.setdefault(name, protocol) is not protocol:
            raise LocalProtocolError("protocol", f"{name!r} is already another protocol")
    return protocol


def named(name: str) -> Protocol:
    """LocalProtocolError names the protocols there are; one of a system is there once its module is imported."""
    protocol = _registered.get(name)
    if protocol is None:
        raise LocalProtocolError("protocol", f"{name!r} is unknown, known are {', '.join(sorted(_registered))}")
    return protocol
