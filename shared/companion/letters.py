"""One form of a text's letters, in which sentences are compared: small, plain, without what nobody
sees.

"ＳＴОＰ", "s\u200btop" and "stop" are one word; "słoik" and "sloik", "don’t" and "don't", too. Must
not know: which words there are.
"""

import re
import unicodedata
from functools import lru_cache

APOSTROPHES = "'`´ʹʻʼʽʾˈˊˋ˴\u0374΄՚՝ᑊᛌ᾽᾿\u1fef\u1ffd῾‘’‛′‵ꞌ＇｀𖽑𖽒"
"""Signs that keyboards, printers and speech recognisers write for one, and that look like one (a
test compares).
"""
INVISIBLE = "\u115f\u1160\u3164\uffa0"
"""Letters that show nothing (fillers of Hangul). Others are found by their category: format,
control, mark.
"""
_NAMED = re.compile(
    r"\b(?:LATIN\b.*|REGIONAL INDICATOR SYMBOL) LETTER (?:SMALL CAPITAL )?([A-Z])(?: WITH .*)?$"
)


def fold(text: str) -> str:
    """The text in small letters without accents and invisible characters; a look-alike as the
    letter it shows.

    A letter that looks like l and like i is "1". Never raises.
    """
    return text.translate({ord(sign): _plain(sign) for sign in set(text)})


@lru_cache(maxsize=4096)  # signs; estimate: more than people write with
def _plain(sign: str) -> str:
    if sign in APOSTROPHES:
        return "'"
    if sign.isspace():
        return " "
    if sign in INVISIBLE or unicodedata.category(sign) in ("Cc", "Cf", "Mn", "Me"):
        return ""
    base = "".join(
        one for one in unicodedata.normalize("NFKD", sign) if not unicodedata.combining(one)
    )
    if base.isascii():
        return base.lower()
    # letters that Unicode does not take apart, such as ł
    if named := _NAMED.search(unicodedata.name(sign, "")):
        return named[1].lower()
    return (_look_alike(sign) if sign.isalnum() else "") or base.casefold()


def _look_alike(sign: str) -> str:
    """The letter or digit of ASCII that a letter of another alphabet looks like; "" where there is
    none.
    """
    # takes 50 ms and 18 MB, which few sentences need
    from confusable_homoglyphs.confusables import confusables_data

    cases = (sign, sign.lower(), sign.upper())
    shapes = (row["c"].lower() for one in cases for row in confusables_data.get(one, ()))
    found = next((shape for shape in shapes if shape.isascii() and shape.isalnum()), "")
    return "1" if found in ("i", "l") else found
