"""Sentences that could be said now: what can be done with the things that were seen, or talked of.

Each is understood as it is written, so that who clicks it has said it. Pure. Must not know: HTTP, tasks.
"""

from collections.abc import Iterator

from companion.languages import cmd
from companion.run_files import InWords, Wish
from services.human_interface.catalogue import THINGS
from services.human_interface.wishes import Context, Option, called, in_words

YES, NO = {"en": "yes", "pl": "tak"}, {"en": "no", "pl": "nie"}
MOST_THINGS = 6
"""Things with sentences of their own; estimate: more buttons than 50 are not looked through."""


def wishes(context: Context) -> tuple[Wish, ...]:
    """Return the sentences, thing by thing, in the order in which the things were told."""
    things = _things(context)[:MOST_THINGS]
    return tuple(
        Wish(does, InWords(called(name, "en"), called(name, "pl")), InWords(in_words((task,)), in_words((task,), "pl")))
        for name in things
        for does, task in _about(name, things)
    )


def _about(name: str, things: tuple[str, ...]) -> Iterator[tuple[str, cmd.Task]]:
    """Yield what can be done with a thing: the verb and the task."""
    yield "take", cmd.Take(name)
    yield "bring", cmd.Bring(name)
    yield "put", cmd.PutDown(name)
    yield "back", cmd.PutDown(name, cmd.BACK)
    for into in things:
        if into != name and all("pour" in THINGS[_kind(one)].can for one in (name, into)):
            yield "pour", cmd.PourInto(name, into)


def replies(options: tuple[Option, ...], language: str) -> tuple[str, ...]:
    """Return the sentences that answer a question: a name or "yes" for each option, and "no"; none where it is none."""
    names = [called(one.thing, language) if len(options) > 1 else YES[language] for one in options]
    return (*names, NO[language]) if names else ()


def _things(context: Context) -> tuple[str, ...]:
    """The things that can be taken, the only one of its kind without a number."""
    seen = tuple(name for name in context.seen or () if _kind(name) in THINGS and "take" in THINGS[_kind(name)].can)
    kinds = [_kind(name) for name in seen]
    named = tuple(name if kinds.count(_kind(name)) > 1 else _kind(name) for name in seen)
    return tuple(dict.fromkeys((*named, *(name for name in context.mentioned if _kind(name) not in kinds))))


def _kind(name: str) -> str:
    return name.partition("_")[0]
