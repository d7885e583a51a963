"""WAY: the right to be in the aisle."""

import msgspec
from fipa_codec.languages import Language


class Sentence(msgspec.Struct, frozen=True, tag=True, forbid_unknown_fields=True):
    """Something said in WAY."""


class Enter(Sentence, frozen=True):
    """Let me through on my way to this station."""

    goal: str


class Left(Sentence, frozen=True):
    """The aisle is behind me."""


Content = Enter | Left
LANGUAGE = Language("WAY", Content)
