"""The catalogue of what people may say: catalogue.toml as typed rows, with those of the tasks.

Must not know: how sentences are parsed, HTTP.
"""

import re
from importlib import resources

import msgspec

from companion import commands
from companion.commands import Make, Wish
from companion.sentences import Reader, catalogue
from companion.stop_words import fold

LANGUAGES = ("en", "pl")


class KindOfThing(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A row [[thing]]: words for a class of the ontology, or for several (`covers`), and what can
    be done with it.

    `many`: words for several of them; `like`: words for things that are like it, by language.
    """

    name: str
    en: tuple[str, ...]
    pl: tuple[str, ...]
    can: tuple[str, ...] = ()
    covers: tuple[str, ...] = ()
    many: dict[str, tuple[str, ...]] = {}
    like: dict[str, tuple[str, ...]] = {}


class Impossible(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A row [[cannot]]: words that hint at what the robot cannot do, the sentence that says so, and
    the wish that is nearest to it.
    """

    says: str
    near: str
    en: str
    pl: str


class TimeRow(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A row [time]: regular expressions of words that say when something is wanted."""

    part: str
    plus: str
    urgent: str
    within: str
    by: str
    later: str
    at: str


class Catalogue(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The whole file."""

    anywhere: dict[str, str]
    opening: dict[str, str]
    common: dict[str, str]
    turning: dict[str, str]
    denying: dict[str, str]
    once_more: dict[str, str]
    standing: dict[str, str]
    question: dict[str, dict[str, str]]
    listing: dict[str, str]
    until: dict[str, str]
    border: dict[str, str]
    excepting: dict[str, str]
    asking: dict[str, str]
    to: dict[str, str]
    source: dict[str, str]
    beside: dict[str, str]
    cannot: tuple[Impossible, ...]
    heard: dict[str, dict[str, str]]
    spelled: dict[str, str]
    joining: dict[str, str]
    time: dict[str, TimeRow]
    number: dict[str, dict[str, float]]
    counted: dict[str, dict[str, int]]
    ordinal: dict[str, dict[str, int]]
    hour: dict[str, dict[str, int]]
    half: dict[str, dict[str, str]]
    unit: dict[str, dict[str, float]]
    clock: dict[str, dict[str, int]]
    side: dict[str, dict[str, str]]
    thing: tuple[KindOfThing, ...]
    rule: dict[str, dict[str, str]]
    wish: tuple[Wish, ...]


def phrases(text: str) -> tuple[tuple[str, ...], ...]:
    """Return the phrases of a list with bars between them, each as its words, the longest first."""
    found = {tuple(re.findall(r"[a-z]+", one)) for one in fold(text).split("|")}
    return tuple(sorted(found - {()}, key=lambda one: (-len(one), one)))


CATALOGUE = msgspec.toml.decode(
    resources.files(__package__).joinpath("catalogue.toml").read_bytes(), type=Catalogue
)
NEAR = {one.says: one.near for one in CATALOGUE.cannot}
THINGS = {one.name: one for one in CATALOGUE.thing}
TASKS = {wish.does: wish for _, wish in commands.wishes()}
"""The wishes for tasks, by rank."""
WISHES = tuple(sorted((*TASKS.values(), *CATALOGUE.wish), key=lambda wish: not wish.first))
LIGHT = frozenset({"the", "yes", "no", "greet"})
"""Names, assent and courtesies: with a wish beside them they count for nothing."""
MAKE: dict[str, Make] = {wish.does: commands.maker(row, wish) for row, wish in commands.wishes()}
RULES = {
    language: commands.table("rule", language, CATALOGUE.rule[language]) for language in LANGUAGES
}
SAY = {
    language: commands.table("say", language, catalogue(Reader(language)).hi)
    for language in LANGUAGES
}


def say(language: str, row: str, *parts: object, **named: object) -> str:
    """Return a sentence of hi's, or of a task."""
    return SAY[language][row].format(*parts, **named)


def abilities(language: str) -> str:
    """Return the list of what is understood."""
    return say(
        language, "can", "; ".join(wish.can[language] for wish in TASKS.values() if wish.can)
    )
