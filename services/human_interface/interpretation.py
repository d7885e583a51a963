"""From the meaning of a sentence to what hi does: commands for co, a question back, or an answer.

An act only if every thing in it is known; where two things fit, or a word is guessed or unknown, a
person is asked, and the options that were offered are kept for the answer. Pure. Must not know:
HTTP, how tasks are carried out.
"""

import itertools
from collections.abc import Iterator

import msgspec
from msgspec.structs import replace

from companion.commands import Offer
from companion.design import AnyCommand
from companion.run_files import InWords, Wish
from services.human_interface.catalogue import MAKE, TASKS, THINGS, abilities, say
from services.human_interface.device_messages import Clause, Meaning, NamedObject
from services.human_interface.grammar import MOST_CHARACTERS, MOST_WISHES, MOST_WORDS

MOST_MENTIONED = 4  # things back that "it" and "the other one" can mean (estimate)


class Option(msgspec.Struct, frozen=True):
    """An answer that was offered: the name of the thing it is about, and the tasks that it stands
    for.
    """

    thing: str
    tasks: tuple[AnyCommand, ...]


class Context(msgspec.Struct, frozen=True, omit_defaults=True):
    """Context of the talk: things mentioned, last one first; options of the open question; things
    that the last look around saw, None before the first one.
    """

    mentioned: tuple[str, ...] = ()
    options: tuple[Option, ...] = ()
    seen: tuple[str, ...] | None = None


class Act(msgspec.Struct, frozen=True):
    """Ask co for these tasks, in this order."""

    tasks: tuple[AnyCommand, ...]


class Ask(msgspec.Struct, frozen=True):
    """Ask back, or refuse and say what would be understood: then there are no options."""

    text: str
    options: tuple[Option, ...] = ()


class Tell(msgspec.Struct, frozen=True):
    """Answer a question, or do what no task is: the row of the catalogue; `task`: which one."""

    does: str
    task: str = ""


Outcome = Act | Ask | Tell


class _Doubt(Exception):
    """A thing is not clear: the question, and the things that it could be."""

    def __init__(self, thing: NamedObject, text: str, names: tuple[str, ...] = ()) -> None:
        self.thing, self.text, self.names = thing, text, names
        super().__init__(text)


def outcome(meaning: Meaning, context: Context) -> Outcome:
    """Return what comes of a sentence."""
    language, clauses = meaning.language, meaning.clauses
    if not clauses:
        return Ask(_not_understood(meaning))
    if any(clause.does not in MAKE or clause.lacks for clause in clauses):
        return _without_task(meaning, context)
    try:
        tasks = _tasks(clauses, context, language)
    except _Doubt as doubt:
        return _ask_back(meaning, context, doubt)
    if meaning.guessed:
        return Ask(say(language, "mean", in_words(tasks, language)), (Option("", tasks),))
    return Act(tasks)


def _without_task(meaning: Meaning, context: Context) -> Outcome:
    """Return the outcome of a question, an answer and the like, which stand alone."""
    language, clauses = meaning.language, meaning.clauses
    clause = clauses[0]
    if len(clauses) > 1:
        return Ask(_not_understood(Meaning(language, why="sorry")))
    if clause.lacks:
        return Ask(say(language, "lacking", TASKS[clause.does].example[language]))
    if clause.does == "the":
        return _outcome_of_a_name(meaning, context)
    if clause.does == "yes":
        if len(context.options) == 1:
            return Act(context.options[0].tasks)
        return Ask(_unasked(language, context))
    if clause.does == "no":
        return Ask(say(language, "not_then")) if context.options else Tell("stop")
    if meaning.guessed:
        return Ask(_not_understood(Meaning(language, why="sorry")))
    return Tell(clause.does, clause.task)


def _outcome_of_a_name(meaning: Meaning, context: Context) -> Outcome:
    """Return the outcome of a thing's name alone: the option offered under that name, or the first
    wish for a thing.
    """
    thing, language = meaning.clauses[0].things[0], meaning.language
    if thing.quality or thing.ref or len(thing.kinds) != 1 or meaning.guessed:
        strange = "" if thing.kinds else thing.said
        return Ask(_not_understood(Meaning(language, why="sorry", strange=strange)))
    name = f"{thing.kinds[0]}_{thing.number}" if thing.number else thing.kinds[0]
    for option in context.options:
        if option.thing == name:
            return Act(option.tasks)
    tasks = (MAKE[_FIRST]((name,), ""),)
    return Ask(say(language, "mean", in_words(tasks, language)), (Option(name, tasks),))


_FIRST = next(
    name for name, wish in TASKS.items() if wish.offer is Offer.THINGS and len(wish.uses) == 1
)


def _unasked(language: str, context: Context) -> str:
    names = ", ".join(noun(option.thing, language) for option in context.options)
    return say(language, "which", names) if names else say(language, "nothing_asked")


def _not_understood(meaning: Meaning) -> str:
    """A refusal with what is understood."""
    language = meaning.language
    first = say(language, "sorry")
    if meaning.why == "long":
        first = say(language, "long", MOST_CHARACTERS, MOST_WORDS)
    elif meaning.why == "many":
        first = say(language, "many", MOST_WISHES)
    strange = f" {say(language, 'strange', meaning.strange)}" if meaning.strange else ""
    return f"{first}{strange} {say(language, 'understood', abilities(language))}"


# --- things ---------------------------------------------------------------------------------------


def _tasks(clauses: tuple[Clause, ...], context: Context, language: str) -> tuple[AnyCommand, ...]:
    """The tasks of all clauses; what one of them names, the next one can call it."""
    tasks: list[AnyCommand] = []
    mentioned = context.mentioned
    for clause in clauses:
        uses = TASKS[clause.does].uses[: len(clause.things)]
        named = zip(clause.things, uses, strict=True)
        names = tuple(
            _resolved_object(thing, use, mentioned, context.seen or (), language)
            for thing, use in named
        )
        if len(set(zip(names, uses, strict=True))) < len(names):
            raise _Doubt(
                clause.things[1], say(language, f"itself_{uses[1]}", noun(names[1], language))
            )
        tasks.append(MAKE[clause.does](names, clause.side))
        mentioned = with_mentioned(mentioned, *names)
    return tuple(tasks)


def with_mentioned(before: tuple[str, ...], *names: str) -> tuple[str, ...]:
    """Return the things that were talked of, these first."""
    return tuple(dict.fromkeys((*names, *before)))[:MOST_MENTIONED]


def forget_objects(context: Context, *things: str) -> Context:
    """Return the context without these things. If one thing of a kind was seen, the name of the
    kind means it.
    """
    seen = context.seen or ()
    kinds = [kind_of(name) for name in seen]
    only = {kind_of(name): name for name in seen if kinds.count(kind_of(name)) == 1}
    gone = {only.get(name, name) for name in things}
    mentioned = tuple(name for name in context.mentioned if only.get(name, name) not in gone)
    kept = None if context.seen is None else tuple(name for name in seen if name not in gone)
    return replace(context, seen=kept, mentioned=mentioned)


def kind_of(name: str) -> str:
    """Return the kind in the name of a thing: "jar" of "jar_2"."""
    return name.partition("_")[0]


def _resolved_object(
    thing: NamedObject, use: str, mentioned: tuple[str, ...], seen: tuple[str, ...], language: str
) -> str:
    """The name of a thing as pl takes it. Raise _Doubt where it is not clear which one is meant;
    any place will do.
    """
    fit = tuple(one.name for one in THINGS.values() if use in one.can)
    if thing.ref:
        return _referred(thing, mentioned, fit, language)
    if not thing.kinds:
        raise _Doubt(thing, say(language, "unknown", thing.said), fit)
    possible = tuple(kind for kind in thing.kinds if kind in fit)
    if not possible:
        raise _Doubt(thing, say(language, f"cannot_{use}", noun(thing.kinds[0], language, 2)))
    if thing.quality:
        raise _Doubt(thing, say(language, "quality", thing.quality), possible)
    if len(possible) > 1:
        raise _Doubt(thing, "", possible)
    (kind,) = possible
    several = tuple(f"{kind}_{n}" for n in range(1, 10) if f"{kind}_{n}" in seen)
    if not thing.number and len(several) > 1 and use != "put":
        raise _Doubt(thing, "", several)
    return f"{kind}_{thing.number}" if thing.number else kind


def _referred(
    thing: NamedObject, mentioned: tuple[str, ...], fit: tuple[str, ...], language: str
) -> str:
    """The thing that a word such as "it" stands for."""
    if thing.ref == "both":
        raise _Doubt(thing, say(language, "one"), fit)
    at = 0 if thing.ref == "it" else 1
    meant = thing.kinds or fit
    known = tuple(name for name in mentioned if kind_of(name) in fit and kind_of(name) in meant)
    if len(known) <= at:
        raise _Doubt(thing, say(language, "name_it", thing.said), thing.kinds or fit)
    return known[at]


def _ask_back(meaning: Meaning, context: Context, doubt: _Doubt) -> Ask:
    """The question, with an option for each thing that would make the sentence clear."""
    language = meaning.language
    options = []
    for name in doubt.names:
        kind, _, number = name.partition("_")
        known = NamedObject(name, (kind,), int(number or 0))
        clauses = tuple(
            replace(one, things=tuple(known if it is doubt.thing else it for it in one.things))
            for one in meaning.clauses
        )
        try:
            options.append(Option(name, _tasks(clauses, context, language)))
        except _Doubt:
            continue
    if len(options) == 1:
        question = say(language, "mean", in_words(options[0].tasks, language))
    elif options:
        question = say(
            language, "which", ", ".join(noun(option.thing, language) for option in options)
        )
    else:
        question = say(language, "understood", abilities(language))
    return Ask(f"{doubt.text} {question}".strip(), tuple(options))


# --- tasks ----------------------------------------------------------------------------------------


def in_words(tasks: tuple[AnyCommand, ...], language: str = "en") -> str:
    """Return a sentence from which the same tasks are understood."""
    return say(language, "then").join(_task_in_words(task, language) for task in tasks)


def _task_in_words(task: AnyCommand, language: str) -> str:
    values = {name: str(getattr(task, name)) for name in task.__struct_fields__}
    fields = {name: _InWords(name, value, language) for name, value in values.items()}
    return say(language, task.says, **fields)


class _InWords:
    """A field of a command in its task's sentences: {object} is the first form of a name,
    {object:2} the third.
    """

    def __init__(self, field: str, value: str, language: str) -> None:
        self._field, self._value, self._language = field, value, language

    def __format__(self, case: str) -> str:
        if self._field == "side":
            return _hand(self._value, self._language)
        if self._field == "place":
            forms = (noun(self._value, self._language, one) for one in range(3))
            return THINGS[self._value.partition("_")[0]].to[self._language].format(*forms)
        return noun(self._value, self._language, int(case or 0))


def _hand(side: str, language: str) -> str:
    return {"left": "lewą", "right": "prawą"}[side] if language == "pl" else side


def noun(name: str, language: str, case: int = 0) -> str:
    """Return the name of a thing in words; Polish: nominative, genitive, accusative."""
    kind, _, number = name.partition("_")
    forms = getattr(THINGS[kind], language)
    word = forms[case if language == "pl" else 0]
    return f"{word} {number}" if number else word


# --- Sentences that could be said now, each understood as it is written ---------------------------

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
        for does, task in _offered(name, things)
    )


def _offered(name: str, things: tuple[str, ...]) -> Iterator[tuple[str, AnyCommand]]:
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


def replies_to(options: tuple[Option, ...], language: str) -> tuple[str, ...]:
    """Return the sentences that answer a question: a name or "yes" for each option, and "no"; none
    where it is none.
    """
    names = [noun(one.thing, language) if len(options) > 1 else YES[language] for one in options]
    return (*names, NO[language]) if names else ()


def _offered_objects(context: Context) -> tuple[str, ...]:
    """The things that something is offered for, the only one of its kind without a number."""
    uses = {wish.uses[0] for wish in TASKS.values() if wish.offer is Offer.THINGS}
    known = [name for name in context.seen or () if kind_of(name) in THINGS]
    seen = tuple(name for name in known if uses & {*THINGS[kind_of(name)].can})
    kinds = [kind_of(name) for name in seen]
    named = tuple(name if kinds.count(kind_of(name)) > 1 else kind_of(name) for name in seen)
    mentioned = (name for name in context.mentioned if kind_of(name) not in kinds)
    return tuple(dict.fromkeys((*named, *mentioned)))
