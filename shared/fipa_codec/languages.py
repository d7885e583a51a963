"""Content languages: a name and the union of tagged Structs that are its sentences (L of the paper's communicate).

A language may also say of what kind a sentence is (still in progress, final): protocols that tell two uses of `inform`
apart read that word. Must not know: which languages a system has, nor any protocol.
"""

from collections.abc import Callable, Iterable
from enum import StrEnum
from typing import Any, get_args

import msgspec

from fipa_codec.communicate import MAX_BYTES, MAX_CONTENT_BYTES, WORD, Communicate, explain, is_word
from fipa_codec.errors import ContentError, LocalProtocolError
from fipa_codec.performatives import Performative


class Kind(StrEnum):
    """Guard word on the rows of a protocol: which use of a performative this is."""

    PLAIN = ""
    """The only use there is; for an inform of `request`: the result."""
    PROGRESS = "progress"
    """News of something that goes on."""
    FINAL = "final"
    """The last report."""
    CANCEL = "cancel"
    """In reply to the cancel. Found out by the conversation from m_t, never by a language."""


_PLAIN = Kind.PLAIN  # found by its class it takes 0.1 us before Python 3.12


class Reason(msgspec.Struct, frozen=True, tag=True, forbid_unknown_fields=True, omit_defaults=True):
    """Why: content of not-understood, and of refuse and failure where a language has no better words."""

    text: str
    field: str = ""


class Language:
    """`name` (L of the communicate), `classes` (what may be said), `.kind(content)`, `check`.

    `union`: a Struct class or a union of tagged ones, or of other types that msgspec can tell apart.
    `kind`: the guard word of a sentence; without it every sentence is PLAIN. `check(performative, content)`: raises
    ContentError where a sentence (None: no content) is not one that the act carries; None: every act carries all.
    LocalProtocolError where the name is no word.
    """

    def __init__(
        self,
        name: str,
        union: Any,
        *,
        kind: Callable[[Any], Kind] | None = None,
        check: Callable[[Performative, Any], None] | None = None,
    ) -> None:
        if not is_word(name):
            raise LocalProtocolError("language", f"cannot be named {name!r}, must match {WORD}")
        self.name = name
        self.union = union
        self.classes: frozenset[type] = frozenset(get_args(union) or (union,))
        self._kind = kind
        self.check = check
        self._decoder = msgspec.msgpack.Decoder(union)

    def __repr__(self) -> str:
        return f"Language({self.name!r}, {len(self.classes)} classes)"

    def encode(self, content: object, performative: Performative | None = None) -> msgspec.Raw:
        """A sentence as content of a communicate.

        LocalProtocolError if its class is not of this language, if `performative`, where given, does not carry it, or
        if it is too long: said here, before an agent has noted it down, it cannot be re-sent for ever.
        """
        if type(content) not in self.classes:
            raise LocalProtocolError("content", f"{type(content).__name__} is no class of {self.name}: {self._known()}")
        if performative is not None and self.check:
            try:
                self.check(performative, content)
            except ContentError as error:
                raise LocalProtocolError(error.field, error.reason) from error
        try:
            data = _encoder.encode(content)
        except Exception as error:
            raise LocalProtocolError("content", f"cannot be encoded in {self.name}: {error}") from error
        if len(data) > MAX_CONTENT_BYTES:
            reason = f"has {len(data)} bytes in {self.name}, at most {MAX_CONTENT_BYTES} are sent; say it in parts"
            raise LocalProtocolError("content", reason)
        return msgspec.Raw(data)

    def decode(self, raw: bytes | msgspec.Raw) -> Any:
        """The sentence in `raw`, an object of one of `classes`. ContentError names the field and the reason."""
        if len(raw) > MAX_BYTES:
            raise ContentError("content", f"is longer than {MAX_BYTES} bytes")
        try:
            return self._decoder.decode(raw)
        except Exception as error:
            field, reason = explain(error, "content")
            raise ContentError(field, f"does not fit language {self.name}: {reason}") from error

    def kind(self, content: object) -> Kind:
        """Which use of its performative a sentence makes."""
        return self._kind(content) if self._kind else _PLAIN

    def _known(self) -> str:
        return ", ".join(sorted(c.__name__ for c in self.classes))


REASON = Language("reason", Reason)
"""The one language every agent reads, since anybody may be told why something was not understood."""

_encoder = msgspec.msgpack.Encoder()


class Languages:
    """The languages of a system by name; REASON is always among them."""

    def __init__(self, languages: Iterable[Language] = ()) -> None:
        self._named = {language.name: language for language in (REASON, *languages)}

    @property
    def names(self) -> tuple[str, ...]:
        """All names, sorted."""
        return tuple(sorted(self._named))

    def named(self, name: str) -> Language:
        """LocalProtocolError names the languages there are."""
        if name not in self._named:
            raise LocalProtocolError("language", f"{name!r} is unknown, known are {', '.join(self.names)}")
        return self._named[name]

    def read(self, communicate: Communicate) -> tuple[Any, Kind]:
        """Content (None if absent) and kind of a received communicate, in the language it names. ContentError."""
        if communicate.language and communicate.language not in self._named:
            known = ", ".join(self.names)
            raise ContentError("language", f"{communicate.language!r} is unknown, known are {known}")
        if communicate.content is msgspec.UNSET:
            silent = self._named[communicate.language].check if communicate.language else None
            if silent:
                silent(communicate.performative, None)
            return None, _PLAIN
        if not communicate.language:
            raise ContentError("language", "is absent, so the content cannot be read")
        language = self._named[communicate.language]
        content = language.decode(communicate.content)
        if language.check:
            language.check(communicate.performative, content)
        return content, language.kind(content)
