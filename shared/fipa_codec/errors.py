"""Exceptions of this package, divided by whose fault it is.

FipaError (abstract)
  LocalProtocolError     the caller asked for something illegal: a bug in the own program
  RemoteProtocolError    the peer sent something illegal; has the performative to answer with
    MalformedError       bytes that are not a communicate
      AclSyntaxError     text that is not an ACL message, with the position (acl_string)
    ContentError         content that does not fit its language or interface

Any other exception raised by this package is a bug in it.
"""

from fipa_codec.performatives import Performative


class FipaError(Exception):
    """Base class. `field` is the wrong part of the message, or ""; `reason` says what is wrong with
    it.
    """

    def __init__(self, field: str, reason: str) -> None:
        if type(self) is FipaError:
            raise TypeError(
                "FipaError does not say whose fault it is; raise LocalProtocolError or"
                " RemoteProtocolError"
            )
        self.field = field
        self.reason = reason
        super().__init__(f"{field}: {reason}" if field else reason)


class LocalProtocolError(FipaError):
    """The caller asked for something that the protocol, the language or the interface forbids."""


class RemoteProtocolError(FipaError):
    """The peer sent something illegal. Answer with `performative`; `reason` can be the content of
    the answer.
    """

    def __init__(
        self, field: str, reason: str, performative: Performative = Performative.NOT_UNDERSTOOD
    ) -> None:
        super().__init__(field, reason)
        self.performative = performative


class MalformedError(RemoteProtocolError):
    """Bytes that are not a communicate. Its sender may be unknown, so an answer is not always
    possible.
    """


class ContentError(RemoteProtocolError):
    """Content that does not fit its language, or does not fit the interface."""
