"""The words of the page: catalogue.toml as typed rows."""

import re
from importlib import resources

import msgspec

from companion.run_files import InWords
from companion.sentences import Reader, thing
from companion.wording import plain

LANGUAGES = ("en", "pl")


class StepRow(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A row [[step]]: a regular expression of a step of a plan, and how a person calls it."""

    of: str
    en: str
    pl: str


class Catalogue(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The whole file."""

    say: dict[str, dict[str, str]]
    leaf: dict[str, InWords]
    step: tuple[StepRow, ...]


CATALOGUE = msgspec.toml.decode(resources.files(__package__).joinpath("catalogue.toml").read_bytes(), type=Catalogue)


def say(language: str, row: str, *parts: object) -> str:
    """Return a sentence of the page."""
    return CATALOGUE.say[language][row].format(*parts)


def step(language: str, name: str) -> str:
    """Return a step of a plan in words; one that is not known as plain English."""
    for row in CATALOGUE.step:
        if found := re.fullmatch(row.of, name):
            return str(getattr(row, language)).format(*(thing(one, Reader(language)) for one in found.groups()))
    return plain(name)


def leaf(language: str, path: str) -> str:
    """Return a leaf of a plan in words, such as "take jar_1/grasp": its step, and what is done in it."""
    at, _, name = path.partition("/")
    verb = name.split("/")[-1].partition(" ")[0]
    done = str(getattr(CATALOGUE.leaf[verb], language)) if verb in CATALOGUE.leaf else plain(name)
    return " ".join(filter(None, (step(language, at), f"({done})" if done else "")))


def preferred(accepted: str) -> str:
    """Return the language for an Accept-Language header: the first in it that is known, English where none is."""
    for one in accepted.lower().split(","):
        if (language := one.strip()[:2]) in LANGUAGES:
            return language
    return LANGUAGES[0]
