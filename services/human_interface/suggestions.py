"""Sentences that could be said now: what can be done with the things that were seen, or talked of.

Each is understood as it is written, so that who clicks it has said it. Pure. Must not know: HTTP.
"""

import itertools
from collections.abc import Iterator

from companion.all_languages import AnyCommand
from companion.commands import Offer
from companion.run_files import InWords, Wish
from services.human_interface.catalogue import MAKE, TASKS, THINGS
from services.human_interface.interpretation import Context, Option, in_words, kind_of, noun

YES, NO = {"en": "yes", "pl": "tak"}, {"en": "no", "pl": "nie"}
MOST_THINGS = 6
"""Things with sentences of their own; estimate: more buttons than 50 are not looked through."""


def wishes(context: Context) -> tuple[Wish, ...]:
    """Return the sentences, thing by thing, in the order in which the things were told."""
    things = _offered_objects(context)[:MOST_THINGS]
    return tuple(
        Wish(
            does,
            InWords(noun(name, "en"), noun(name, "pl")),
            InWords(in_words((task,)), in_words((task,), "pl")),
        )
        for name in things
        for does, task in _about(name, things)
    )


def _about(name: str, things: tuple[str, ...]) -> Iterator[tuple[str, AnyCommand]]:
    """Yield what can be done with a thing, and others beside it: the name of the wish, and the
    task.
    """
    for does, wish in TASKS.items():
        if wish.offer is Offer.THINGS:
            beside = [one for one in things if one != name]
            others = itertools.permutations(beside, len(wish.uses) - 1)
            for names in ((name, *rest) for rest in others):
                if all(
                    use in THINGS[kind_of(one)].can
                    for one, use in zip(names, wish.uses, strict=True)
                ):
                    yield does, MAKE[does](names, "")


def replies(
    options: tuple[Option, ...], language: str, sentences: tuple[str, ...] = ()
) -> tuple[str, ...]:
    """Return the sentences that answer a question: a name or "yes" for each option, further ones,
    and "no"; none where it is none.
    """
    names = [noun(one.thing, language) if len(options) > 1 else YES[language] for one in options]
    return (*names, *sentences, NO[language]) if names or sentences else ()


def _offered_objects(context: Context) -> tuple[str, ...]:
    """The things that something is offered for, the only one of its kind without a number."""
    uses = {wish.uses[0] for wish in TASKS.values() if wish.offer is Offer.THINGS}
    known = [name for name in context.seen or () if kind_of(name) in THINGS]
    seen = tuple(name for name in known if uses & {*THINGS[kind_of(name)].can})
    kinds = [kind_of(name) for name in seen]
    named = tuple(name if kinds.count(kind_of(name)) > 1 else kind_of(name) for name in seen)
    mentioned = (name for name in context.mentioned if kind_of(name) not in kinds)
    return tuple(dict.fromkeys((*named, *mentioned)))
