"""From the meaning of a sentence to what hi does: commands for co, a question back, or an answer.

An act only if every thing in it is known; where two things fit, or a word is guessed or unknown, a person is asked, and
the options that were offered are kept for the answer. Pure. Must not know: HTTP, how tasks are carried out.
"""

from collections.abc import Callable

import msgspec

from companion.languages import cmd
from services.human_interface.catalogue import THINGS, say
from services.human_interface.grammar import MOST_CHARACTERS, MOST_WISHES, MOST_WORDS
from services.human_interface.meaning import Clause, Meaning, Thing

EXAMPLE = {
    "en": {"pour": "pour the jar into the bowl", "take": "take the jar"},
    "pl": {"pour": "wlej zawartość słoika do miski", "take": "weź słoik"},
}
USE = {"pour": ("pour", "pour"), "fill": ("pour", "pour"), "place": ("take", "put")}
"""Uses that the things of a wish must be good for (catalogue: can), by wish; else one is taken."""
MOST_MENTIONED = 4  # things back that "it" and "the other one" can mean (estimate)


class Option(msgspec.Struct, frozen=True):
    """An answer that was offered: the name of the thing it is about, and the tasks that it stands for."""

    thing: str
    tasks: tuple[cmd.Task, ...]


class Context(msgspec.Struct, frozen=True, omit_defaults=True):
    """Context of the talk: things mentioned, last one first; options of the open question; things that the last look
    around saw, None before the first one.
    """

    mentioned: tuple[str, ...] = ()
    options: tuple[Option, ...] = ()
    seen: tuple[str, ...] | None = None


class Act(msgspec.Struct, frozen=True):
    """Ask co for these tasks, in this order."""

    tasks: tuple[cmd.Task, ...]


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

    def __init__(self, thing: Thing, text: str, names: tuple[str, ...] = ()) -> None:
        self.thing, self.text, self.names = thing, text, names
        super().__init__(text)


def outcome(meaning: Meaning, context: Context) -> Outcome:
    """Return what comes of a sentence."""
    language, clauses = meaning.language, meaning.clauses
    if not clauses:
        return Ask(_not_understood(meaning))
    if any(clause.does not in MAKE for clause in clauses):
        return _without_task(meaning, context)
    try:
        tasks = _tasks(clauses, context, language)
    except _Doubt as doubt:
        return _asked(meaning, context, doubt)
    if meaning.guessed:
        return Ask(say(language, "mean", in_words(tasks, language)), (Option("", tasks),))
    return Act(tasks)


def _without_task(meaning: Meaning, context: Context) -> Outcome:
    """Return the outcome of a question, an answer and the like, which stand alone."""
    language, clauses = meaning.language, meaning.clauses
    clause = clauses[0]
    if len(clauses) > 1:
        return Ask(_not_understood(Meaning(language, why="sorry")))
    if clause.does == "the":
        return _named(meaning, context)
    if clause.does == "yes":
        return Act(context.options[0].tasks) if len(context.options) == 1 else Ask(_unasked(language, context))
    if clause.does == "no":
        return Ask(say(language, "not_then")) if context.options else Tell("stop")
    if clause.does == "lacking":
        return Ask(say(language, "lacking", EXAMPLE[language]["pour" if clause.things else "take"]))
    if meaning.guessed:
        return Ask(_not_understood(Meaning(language, why="sorry")))
    return Tell(clause.does, clause.task)


def _named(meaning: Meaning, context: Context) -> Outcome:
    """Return the outcome of a thing's name alone: the option offered under that name, or the wish to have it."""
    thing, language = meaning.clauses[0].things[0], meaning.language
    if thing.quality or thing.ref or len(thing.kinds) != 1 or meaning.guessed:
        return Ask(_not_understood(Meaning(language, why="sorry", strange="" if thing.kinds else thing.said)))
    name = f"{thing.kinds[0]}_{thing.number}" if thing.number else thing.kinds[0]
    for option in context.options:
        if option.thing == name:
            return Act(option.tasks)
    return Ask(say(language, "mean", in_words((cmd.Take(name),), language)), (Option(name, (cmd.Take(name),)),))


def _unasked(language: str, context: Context) -> str:
    names = ", ".join(called(option.thing, language) for option in context.options)
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
    return f"{first}{strange} {say(language, 'understood', say(language, 'can'))}"


# --- things -----------------------------------------------------------------------------------------------------------


def _tasks(clauses: tuple[Clause, ...], context: Context, language: str) -> tuple[cmd.Task, ...]:
    """The tasks of all clauses; what one of them names, the next one can call it."""
    tasks: list[cmd.Task] = []
    mentioned = context.mentioned
    for clause in clauses:
        uses = zip(clause.things, USE.get(clause.does, ("take",)), strict=False)
        names = tuple(_thing(thing, use, mentioned, context.seen or (), language) for thing, use in uses)
        tasks.append(MAKE[clause.does](clause, names, language))
        mentioned = with_mentioned(mentioned, *names)
    return tuple(tasks)


def with_mentioned(before: tuple[str, ...], *names: str) -> tuple[str, ...]:
    """Return the things that were talked of, these first."""
    return tuple(dict.fromkeys((*names, *before)))[:MOST_MENTIONED]


def _thing(thing: Thing, use: str, mentioned: tuple[str, ...], seen: tuple[str, ...], language: str) -> str:
    """The name of a thing as pl takes it. Raise _Doubt where it is not clear which one is meant; any place will do."""
    fit = tuple(one.name for one in THINGS.values() if use in one.can)
    if thing.ref:
        return _referred(thing, mentioned, fit, language)
    if not thing.kinds:
        raise _Doubt(thing, say(language, "unknown", thing.said), fit)
    possible = tuple(kind for kind in thing.kinds if kind in fit)
    if not possible:
        raise _Doubt(thing, say(language, f"cannot_{use}", called(thing.kinds[0], language, 2)))
    if thing.quality:
        raise _Doubt(thing, say(language, "quality", thing.quality), possible)
    if len(possible) > 1:
        raise _Doubt(thing, "", possible)
    (kind,) = possible
    several = tuple(f"{kind}_{n}" for n in range(1, 10) if f"{kind}_{n}" in seen)
    if not thing.number and len(several) > 1 and use != "put":
        raise _Doubt(thing, "", several)
    return f"{kind}_{thing.number}" if thing.number else kind


def _referred(thing: Thing, mentioned: tuple[str, ...], fit: tuple[str, ...], language: str) -> str:
    """The thing that a word such as "it" stands for."""
    if thing.ref == "both":
        raise _Doubt(thing, say(language, "one"), fit)
    at = 0 if thing.ref == "it" else 1
    meant = thing.kinds or fit
    known = tuple(name for name in mentioned if name.partition("_")[0] in fit and name.partition("_")[0] in meant)
    if len(known) <= at:
        raise _Doubt(thing, say(language, "name_it", thing.said), thing.kinds or fit)
    return known[at]


def _asked(meaning: Meaning, context: Context, doubt: _Doubt) -> Ask:
    """The question, with an option for each thing that would make the sentence clear."""
    language = meaning.language
    options = []
    for name in doubt.names:
        kind, _, number = name.partition("_")
        known = Thing(name, (kind,), int(number or 0))
        clauses = tuple(
            msgspec.structs.replace(one, things=tuple(known if thing is doubt.thing else thing for thing in one.things))
            for one in meaning.clauses
        )
        try:
            options.append(Option(name, _tasks(clauses, context, language)))
        except _Doubt:
            continue
    if len(options) == 1:
        question = say(language, "mean", in_words(options[0].tasks, language))
    elif options:
        question = say(language, "which", ", ".join(called(option.thing, language) for option in options))
    else:
        question = say(language, "understood", say(language, "can"))
    return Ask(f"{doubt.text} {question}".strip(), tuple(options))


# --- tasks ------------------------------------------------------------------------------------------------------------


def _pour(clause: Clause, names: tuple[str, ...], language: str) -> cmd.Task:
    source, destination = names if clause.does == "pour" else names[::-1]
    if source == destination:
        raise _Doubt(clause.things[1], say(language, "itself", called(source, language)))
    return cmd.PourInto(source, destination)


MAKE: dict[str, Callable[[Clause, tuple[str, ...], str], cmd.Task]] = {
    "pour": _pour,
    "fill": _pour,
    "take": lambda clause, names, language: cmd.Take(names[0], clause.side),
    "bring": lambda clause, names, language: cmd.Bring(names[0], clause.side),
    "swap": lambda clause, names, language: cmd.SwapHands(*names),
    "put": lambda clause, names, language: cmd.PutDown(names[0]),
    "place": lambda clause, names, language: cmd.PutDown(*names),
    "back": lambda clause, names, language: cmd.PutDown(names[0], cmd.BACK),
    "clear": lambda clause, names, language: cmd.ClearTable(),
    "look": lambda clause, names, language: cmd.LookAround(),
}
"""The rows of the catalogue that become tasks of co."""


def things_of(task: cmd.Task) -> tuple[str, ...]:
    """Return the names of the things of a task."""
    return tuple(name for field in ("source", "destination", "object") if (name := getattr(task, field, "")))


def in_words(tasks: tuple[cmd.Task, ...], language: str = "en") -> str:
    """Return a sentence from which the same tasks are understood."""
    return say(language, "then").join(_task_in_words(task, language) for task in tasks)


def _task_in_words(task: cmd.Task, language: str) -> str:
    match task:
        case cmd.PourInto(source=source, destination=destination):
            return say(language, "pour", called(source, language, 1), called(destination, language, 1))
        case cmd.Take(object=thing, side=""):
            return say(language, "take", called(thing, language, 2))
        case cmd.Take(object=thing, side=side):
            return say(language, "take_side", called(thing, language, 2), _hand(side, language))
        case cmd.Bring(object=thing, side=""):
            return say(language, "bring", called(thing, language, 2))
        case cmd.Bring(object=thing, side=side):
            return say(language, "bring_side", called(thing, language, 2), _hand(side, language))
        case cmd.SwapHands(object=""):
            return say(language, "swap")
        case cmd.SwapHands(object=thing):
            return say(language, "swap_thing", called(thing, language, 2))
        case cmd.PutDown(object=thing, place=place):
            return _put_in_words(called(thing, language, 2), place, language)
        case cmd.ClearTable():
            return say(language, "clear")
        case cmd.LookAround():
            return say(language, "look")


def _put_in_words(thing: str, place: str, language: str) -> str:
    if place in ("", cmd.BACK):
        return say(language, "back" if place else "put", thing)
    forms = (called(place, language, case) for case in range(3))
    return say(language, "place", thing, THINGS[place.partition("_")[0]].to[language].format(*forms))


def _hand(side: str, language: str) -> str:
    return {"left": "lewą", "right": "prawą"}[side] if language == "pl" else side


def called(name: str, language: str, case: int = 0) -> str:
    """Return the name of a thing in words; Polish: nominative, genitive, accusative."""
    kind, _, number = name.partition("_")
    forms = getattr(THINGS[kind], language)
    word = forms[case if language == "pl" else 0]
    return f"{word} {number}" if number else word
