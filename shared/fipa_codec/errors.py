"""What can be wrong with a communicate, and whose fault it is.

FipaError (never raised itself)
  LocalProtocolError     our own code asked for something illegal; raises loudly
  RemoteProtocolError    the peer did; never kills an agent, carries the performative to answer with
    MalformedError       bytes that are no communicate
      AclSyntaxError     text that is no ACL message, with its place (acl_string)
    ContentError         content that does not fit its language or interface

Any other exception that leaves this package is a bug in it. Must not know: agents, transport.
"""

from fipa_codec.performatives import Performative


class FipaError(Exception):
    """`field` (the paper's name of the wrong part, or "") and `reason` in words; the sentence is built from them."""

    def __init__(self, field: str, reason: str) -> None:
        if type(self) is FipaError:
            raise TypeError("FipaError says nothing about whose fault it is: raise one of its subclasses")
        self.field = field
        self.reason = reason
        super().__init__(f"{field}: {reason}" if field else reason)


class LocalProtocolError(FipaError):
    """We asked for something that the protocol, the language or the interface forbids."""


class RemoteProtocolError(FipaError):
    """The peer sent something illegal. `performative` is what to answer with, `reason` the content of that answer."""

    def __init__(self, field: str, reason: str, performative: Performative = Performative.NOT_UNDERSTOOD) -> None:
        super().__init__(field, reason)
        self.performative = performative


class MalformedError(RemoteProtocolError):
    """Bytes that are no communicate: there may be nobody to answer."""


class ContentError(RemoteProtocolError):
    """Content that does not fit its language, or arguments that do not fit the interface."""
