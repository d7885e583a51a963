"""Registry of what a person may ask: the command of each task, and the sentences that ask for it.

They are in the folder of the task: `command.py` has its ROW; `phrases.toml` has patterns of
sentences for hi's grammar (`services/human_interface/catalogue.toml` explains patterns), and what
hi and the page say.
"""

from collections.abc import Callable, Iterator
from enum import StrEnum
from functools import cache
from importlib import resources

import msgspec

from companion import tasks
from companion.languages.cmd import Command
from companion.sentences import Reader, hand, noun, where

Make = Callable[[tuple[str, ...], str], Command]
"""Make a command of the things that a sentence names, in the order of its pattern, and a side, ""
for none.
"""


class Offer(StrEnum):
    """Buttons for a wish: none, one for the wish without a thing, or one for each thing that was
    seen and fits.
    """

    NONE = ""
    ALONE = "alone"
    THINGS = "things"


class Wish(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A row [[wish]]: sentences of these patterns mean the same.

    `uses`: what the things in it must be good for, in the order of the pattern (`can` of hi's
    [[thing]]). `lacking`: patterns in which something is left out; it is asked for. `unsure`:
    patterns with something that cannot be done so, by the sentence of [say] that says what; it is
    asked whether to do it nevertheless. `can`: its entry in the list of what is understood. `undo`:
    the wish that undoes this one with the first of its things. `first`: it is tried before those of
    the tasks. `hint`: phrases, as rows of stop_words.toml are written, that hint at it in a
    sentence that no pattern fits. `sided`: a hand can be named for it. `held`: it is offered only
    while the first of its things, or any without one, is in a hand, or is not; None: always.
    `alike`: other wishes that its patterns under `unsure.either` may mean as well; which one is
    asked.
    """

    does: str
    en: tuple[str, ...]
    pl: tuple[str, ...]
    uses: tuple[str, ...] = ()
    offer: Offer = Offer.NONE
    lacking: dict[str, tuple[str, ...]] = {}
    example: dict[str, str] = {}
    can: dict[str, str] = {}
    unsure: dict[str, dict[str, tuple[str, ...]]] = {}
    undo: str = ""
    first: bool = False
    hint: dict[str, str] = {}
    sided: bool = False
    held: bool | None = None
    alike: tuple[str, ...] = ()

    def texts(self, language: str, how: str) -> tuple[str, ...]:
        """The patterns of a language: as the wish is said (""), with something left out ("lacks"),
        or with something that cannot be done so.
        """
        if how == "lacks":
            return self.lacking.get(language, ())
        return self.unsure.get(how, {}).get(language, ()) if how else getattr(self, language)


class Phrases(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A file phrases.toml. `rank`: where the task comes in lists for people, lowest first. All
    tables by language.

    `rule`: rules that its patterns share. `say`: sentences; the one that `Command.says` names is
    understood as it is written, and its blanks are fields of the command: `{object:1}` the
    genitive, `:2` the accusative, `{side:1}` the instrumental. `cannot_USE` is said of a thing that
    is not good for a use, `itself_USE` where one is named twice.
    """

    rank: int
    wish: tuple[Wish, ...]
    say: dict[str, dict[str, str]]
    rule: dict[str, dict[str, str]] = {}


class Row(msgspec.Struct, frozen=True):
    """What a task adds. `make`: by the name of the wish."""

    content: type[Command]
    make: dict[str, Make]
    phrases: Phrases


def phrases(module: str) -> Phrases:
    """The phrases beside this module of a task."""
    file = resources.files(module.rpartition(".")[0]).joinpath("phrases.toml")
    return msgspec.toml.decode(file.read_bytes(), type=Phrases)


@cache
def rows() -> tuple[Row, ...]:
    """The rows of all tasks that a person may ask for, by rank."""
    found: Iterator[Row] = (part.ROW for part in tasks.parts("command"))
    return tuple(sorted(found, key=lambda row: row.phrases.rank))


def wishes() -> tuple[tuple[Row, Wish], ...]:
    """The wishes of all tasks, each with the row of its task."""
    return tuple((row, wish) for row in rows() for wish in row.phrases.wish)


def maker(row: Row, wish: Wish) -> Make:
    """The function that makes the command of a wish. Raises ValueError if its row has none of that
    name.
    """
    if wish.does not in row.make:
        named = ", ".join(row.make)
        raise ValueError(
            f"phrases of {row.content.__name__}: does = {wish.does!r}, but its ROW makes {named};"
            " one name for both"
        )
    return row.make[wish.does]


def table(name: str, language: str, general: dict[str, str]) -> dict[str, str]:
    """A table of Phrases with the rows of all tasks behind the general ones. Raises ValueError if
    two agree.
    """
    found = dict(general)
    for row in rows():
        more: dict[str, str] = getattr(row.phrases, name).get(language, {})
        if twice := sorted(found.keys() & more.keys()):
            raise ValueError(
                f"phrases of {row.content.__name__}: another [{name}.{language}] has"
                f" {', '.join(twice)}"
            )
        found |= more
    return found


def in_words(command: Command, language: str) -> str:
    """A sentence from which the same command is understood, in "en" or "pl"."""
    reader = Reader(language)
    said = {"side": hand, "place": where}
    fields = {
        name: said.get(name, noun)(str(getattr(command, name)), reader)
        for name in command.__struct_fields__
    }
    return _says(language)[command.says].format(**fields)


@cache
def _says(language: str) -> dict[str, str]:
    return table("say", language, {})


def example(language: str) -> str:
    """A sentence to begin with."""
    return next(wish.example[language] for _, wish in wishes() if wish.example)


def survey() -> Command:
    """The command to look around."""
    return next(row.content() for row in rows() if row.content.surveys)
