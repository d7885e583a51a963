"""Any text of another platform as a word or label of ours, and back, one to one.

A text that is a word or label already stays what it is. Any other text becomes `acl:` (label) or `acl-` (word) and the
text with its other characters as two hexadecimal digits per byte of UTF-8: the label `a b` is `acl:a%20b`, the word
`ams@host:1099/JADE` is `acl-ams@host_3A1099_2FJADE`. A text that looks like such an escape is escaped, too.
"""

import re
from collections.abc import Callable
from typing import NamedTuple
from urllib.parse import quote, unquote_to_bytes

from fipa_codec.communicate import is_label, is_word


class Escape(NamedTuple):
    """Escaping of one kind of text; `mark`: the characters before two hexadecimal digits."""

    fits: Callable[[str], bool]
    prefix: str
    mark: str
    safe: str

    def enter(self, text: str) -> str:
        """Return our text for one of another platform; it can be too long to be a word or label.

        Raise UnicodeEncodeError for half a surrogate pair.
        """
        return text if self._stays(text) else self._escaped(text)

    def leave(self, text: str) -> str:
        """Return the text of another platform for one of ours."""
        meant = self._meant_by(text)
        return text if meant is None else meant

    def _escaped(self, text: str) -> str:
        quoted = quote(text, safe=self.safe)
        if self.mark != "%":  # a character outside of `safe` that quote leaves as it is
            quoted = re.sub("[~_]", lambda found: f"%{ord(found[0]):02X}", quoted).replace("%", self.mark)
        return self.prefix + quoted

    def _meant_by(self, text: str) -> str | None:
        """Return what a text of ours stands for, None unless it is what `enter` makes of it."""
        if not text.startswith(self.prefix):
            return None
        try:
            meant = unquote_to_bytes(text.removeprefix(self.prefix).replace(self.mark, "%")).decode()
        except UnicodeDecodeError:
            return None
        return None if self._stays(meant) or self._escaped(meant) != text else meant

    def _stays(self, text: str) -> bool:
        return not text or (self.fits(text) and self._meant_by(text) is None)


LABEL = Escape(is_label, "acl:", "%", "!\"#$&'()*+,-./:;<=>?@[\\]^_`{|}~")
WORD = Escape(is_word, "acl-", "_", "@-.")
