"""The words of the page, from the catalogue of its language (companion.sentences)."""

from companion.sentences import Reader, catalogue

LANGUAGES = ("en", "pl")
WORDS = {language: catalogue(Reader(language)).page for language in LANGUAGES}


def say(language: str, row: str, *parts: object) -> str:
    """Return a sentence of the page."""
    return WORDS[language][row].format(*parts)


def preferred(accepted: str) -> str:
    """Return the language for an Accept-Language header: the first in it that is known, English where none is."""
    for one in accepted.lower().split(","):
        if (language := one.strip()[:2]) in LANGUAGES:
            return language
    return LANGUAGES[0]
