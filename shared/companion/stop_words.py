"""The words that stop the robot, in English and Polish: looked for before any grammar, in whatever else is said.

They err towards stopping: a robot that stood still for nothing is let go by `roco release`, one that went on is not
made good. Rows, not rules: a further word is a further row. Letters are compared without case, accents and
repetition, so that "STOOOP!" and "stój" are found. Must not know: the robot, HTTP, which tasks there are.
"""

import re
import string
import unicodedata
from collections.abc import Iterator

LONGEST = 10_000  # characters that are looked through (estimate: hi takes bodies of 4096 bytes)

WORDS = """
stop halt freeze whoa woah emergency estop abort
danger dangerous unsafe careful enough wait pause ouch hurts hurting spilling
falling cease quit beware fire
stój zatrzymaj zatrzymać zatrzymajcie przestań przerwij czekaj poczekaj zaczekaj uważaj uwaga dość dosyć wystarczy
chwileczkę awaria alarm niebezpiecznie boli ratunku zostaw aua
"""
"""Anywhere in a sentence."""

PHRASES = """
do not|must not|should not|not there|not that|not so fast|no more|no no|no wait|no not|never do that
hang on|hold on|hold still|hold up|hold your|hold everything|watch out|watch it|look out|mind my|mind the
slow down|back off|hands off|get off|let me go|let go of me|let go of my|leave me alone|leave it alone|leave that alone
keep still|stand still|stay still|stay there|stay where|stay put|shut down|switch off|turn off|power off|cut it out
knock it off|just a second|just a moment|just a minute|one second|one moment|one minute|a second|help help
that is wrong|wrong one|wrong hand|wrong way|wrong thing|you are dropping|you are hurting|e stop|s t o p|red button
kill switch|do nothing
nie nie|nie rób|nie ruszaj|nie dotykaj|ani kroku|ręce precz|za szybko|czerwony przycisk|to boli
"""
"""Anywhere, as words that follow one another."""

OPENINGS = """
hold it|easy|steady|mind|stay|never|nie|chwila|moment|ostrożnie|spokojnie|pomocy
"""
"""At the beginning of a sentence."""

HARMLESS = """
i do not|we do not|they do not|why do not|never mind|nie wiem|nie rozumiem|nie widzę|nie trzeba|nie dziękuję
"""
"""No stop: taken out before the others are looked for."""

NEARLY = ("stop", "halt", "freeze", "stoj")
"""Found with a letter wrong, too, where a sentence has no more than two words."""
OTHER_WORDS = frozenset({"step", "shop", "slop", "salt", "half", "hal", "hat", "malt", "stol", "sto"})
"""Words of their own that are a letter away from one of NEARLY."""

_SHORT = ((r"\b(can|won|do|did|does|must|should)n?['’]?t\b", r"\1 not"), (r"['’]re\b", " are"), (r"['’]s\b", " is"))
_PLAIN = str.maketrans("łø", "lo")


def stop_words(sentence: str) -> str:
    """Return the words of a sentence that stop the robot; "" where it has none. Never raises."""
    words = _words(sentence)
    if not words:
        return ""
    text = f" {' '.join(words)} "
    for harmless in _HARMLESS:
        text = text.replace(f" {harmless} ", " ")
    anywhere = (one for one in (*_PHRASES, *_WORDS) if f" {one} " in text)
    opening = (one for one in _OPENINGS if text.startswith(f" {one} "))
    near = (word for word in words if len(words) <= 2 and word in _NEAR)
    return next(anywhere, "") or next(opening, "") or next(near, "")


def _words(sentence: str) -> list[str]:
    """The words in small letters without accents; a letter that is repeated counts once."""
    text = sentence[:LONGEST].lower()
    for form, whole in _SHORT:
        text = re.sub(form, whole, text)
    bare = "".join(one for one in unicodedata.normalize("NFKD", text) if not unicodedata.combining(one))
    return [re.sub(r"(.)\1+", r"\1", word) for word in re.findall(r"[^\W_]+", bare.lower().translate(_PLAIN))]


def _slips(word: str) -> Iterator[str]:
    """Words with a letter wrong, missing or too much, or two in the other order."""
    for at in range(len(word) + 1):
        yield word[:at] + word[at + 1 :]
        yield word[:at] + word[at + 1 : at + 2] + word[at : at + 1] + word[at + 2 :]
        for letter in string.ascii_lowercase:
            yield word[:at] + letter + word[at:]
            yield word[:at] + letter + word[at + 1 :]


def _rows(text: str, split: str) -> tuple[str, ...]:
    return tuple(" ".join(_words(one)) for one in re.split(split, text) if one.strip())


_WORDS, _PHRASES = _rows(WORDS, r"\s"), _rows(PHRASES, r"[|\n]")
_OPENINGS, _HARMLESS = _rows(OPENINGS, r"[|\n]"), _rows(HARMLESS, r"[|\n]")
_NEAR = {" ".join(_words(slip)) for one in NEARLY for slip in _slips(one)} - OTHER_WORDS
