"""Content languages: a name and a union of tagged Structs, its sentences (L of the paper's
communicate).

A language may also classify sentences (progress, final), for protocols that distinguish uses of
`inform`. Independent of protocols and of the languages of any system.
"""

from collections.abc import Callable, Iterable
from enum import StrEnum
from typing import Any, get_args

import msgspec

from fipa_codec.communicate import MAX_BYTES, MAX_CONTENT_BYTES, WORD, Communicate, explain, is_word
from fipa_codec.errors import ContentError, LocalProtocolError
from fipa_codec.performatives import Performative


class Kind(StrEnum):
    """The use of a performative, as the rows of a protocol distinguish it."""

    PLAIN = ""
    """No distinction; for an inform of `request`: the result."""
    PROGRESS = "progress"
    """A report of an act that continues."""
    FINAL = "final"
    """The last report."""
    CANCEL = "cancel"
    """In reply to the cancel. Determined by the conversation from m_t, never by a language."""


_PLAIN = Kind.PLAIN  # before Python 3.12 access by the class takes 0.1 us


class Reason(msgspec.Struct, frozen=True, tag=True, forbid_unknown_fields=True, omit_defaults=True):
    """A reason: content of not-understood, and of refuse and failure where a language has no
    sentence of its own.
    """

    text: str
    field: str = ""


class Language:
    """A content language: `name` (L of the communicate), `classes` of its sentences, encoder and
    decoder.

    `union` is a Struct class, a union of tagged Structs, or a union of other types that msgspec can
    distinguish. `kind` returns the kind of a sentence; default: PLAIN. `check(performative,
    content)` raises ContentError if the act does not carry the sentence (None: no content);
    default: every act carries every sentence. Raise LocalProtocolError if the name is not a valid
    word.
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

        Raise LocalProtocolError if its class is not in this language, if `performative` (where
        given) does not carry it, or if it is too long. Checked here, before an agent journals the
        message, since it would re-send it for ever.
        """
        if type(content) not in self.classes:
            raise LocalProtocolError(
                "content",
                f"{type(content).__name__} is not a class of {self.name}: {self._known()}",
            )
        if performative is not None and self.check:
            try:
                self.check(performative, content)
            except ContentError as error:
                raise LocalProtocolError(error.field, error.reason) from error
        try:
            data = _encoder.encode(content)
        except Exception as error:
            raise LocalProtocolError(
                "content", f"cannot be encoded in {self.name}: {error}"
            ) from error
        if len(data) > MAX_CONTENT_BYTES:
            reason = (
                f"has {len(data)} bytes in {self.name}, at most {MAX_CONTENT_BYTES} are sent; send"
                " it in parts"
            )
            raise LocalProtocolError("content", reason)
        return msgspec.Raw(data)

    def decode(self, raw: bytes | msgspec.Raw) -> Any:
        """The sentence in `raw`, an object of one of `classes`.

        Raise ContentError with the field and the reason.
        """
        if len(raw) > MAX_BYTES:
            raise ContentError("content", f"is longer than {MAX_BYTES} bytes")
        try:
            return self._decoder.decode(raw)
        except Exception as error:
            field, reason = explain(error, "content")
            raise ContentError(field, f"does not fit language {self.name}: {reason}") from error

    def kind(self, content: object) -> Kind:
        """The kind of a sentence."""
        return self._kind(content) if self._kind else _PLAIN

    def _known(self) -> str:
        return ", ".join(sorted(c.__name__ for c in self.classes))


REASON = Language("reason", Reason)
"""The language that every agent understands: any agent may receive a not-understood with its
reason.
"""

_encoder = msgspec.msgpack.Encoder()


class Languages:
    """The languages of a system by name, always with REASON."""

    def __init__(self, languages: Iterable[Language] = ()) -> None:
        self._named = {language.name: language for language in (REASON, *languages)}

    @property
    def names(self) -> tuple[str, ...]:
        """All names, sorted."""
        return tuple(sorted(self._named))

    def named(self, name: str) -> Language:
        """The language of this name. Raise LocalProtocolError, with the known names, if there is
        none.
        """
        if name not in self._named:
            raise LocalProtocolError(
                "language", f"{name!r} is unknown, known are {', '.join(self.names)}"
            )
        return self._named[name]

    def read(self, communicate: Communicate) -> tuple[Any, Kind]:
        """Content (None if absent) and kind of a received communicate, decoded in the language it
        names.

        Raise ContentError if the language is unknown or absent, or the content does not fit it.
        """
        if communicate.language and communicate.language not in self._named:
            known = ", ".join(self.names)
            raise ContentError(
                "language", f"{communicate.language!r} is unknown, known are {known}"
            )
        if communicate.content is msgspec.UNSET:
            check = self._named[communicate.language].check if communicate.language else None
            if check:
                check(communicate.performative, None)
            return None, _PLAIN
        if not communicate.language:
            raise ContentError("language", "is absent, so the content cannot be decoded")
        language = self._named[communicate.language]
        content = language.decode(communicate.content)
        if language.check:
            language.check(communicate.performative, content)
        return content, language.kind(content)
