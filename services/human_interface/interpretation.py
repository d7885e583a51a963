"""From the meaning of a sentence to what hi does: commands for co, a question back, or an answer.

An act only if every thing in it is known; where two things fit, or a word is guessed or unknown, a
person is asked, and the options that were offered are kept for the answer. Pure. Must not know:
HTTP, how tasks are carried out.
"""

import contextlib
import itertools
from collections.abc import Callable, Collection, Iterator
from typing import NamedTuple

import msgspec
from msgspec.structs import replace

from companion import commands
from companion.commands import Offer
from companion.design import AnyCommand
from companion.run_files import InWords, Wish
from services.human_interface.catalogue import CATALOGUE, LIGHT, MAKE, NEAR, TASKS, THINGS, say
from services.human_interface.device_messages import (
    Clause,
    Hints,
    Meaning,
    Mention,
    NamedObject,
    Part,
)
from services.human_interface.grammar import MOST_CHARACTERS, MOST_WISHES, MOST_WORDS

EITHER = "either"  # how a form asks for one of several wishes: which one is not clear
MOST_EXAMPLES = 3  # in a refusal (estimate)
MOST_MENTIONED = 4  # things back that "it" and "the other one" can mean (estimate)


class Option(msgspec.Struct, frozen=True, omit_defaults=True):
    """An answer that was offered: the name of the thing it is about, and the tasks that it stands
    for. `clauses`: the same as wishes; `instead`: the tasks of the sentence before are cancelled;
    `sure`: the question was whether to do what cannot be undone.
    """

    thing: str
    tasks: tuple[AnyCommand, ...]
    clauses: tuple[Clause, ...] = ()
    instead: bool = False
    sure: bool = False


class Context(msgspec.Struct, frozen=True, omit_defaults=True):
    """Context of the talk: things mentioned, last one first; options of the open question; things
    that the last look around saw, None before the first one; the wishes that were done last, and
    whether something is still to be done.
    """

    mentioned: tuple[str, ...] = ()
    options: tuple[Option, ...] = ()
    seen: tuple[str, ...] | None = None
    last: tuple[Clause, ...] = ()
    busy: bool = False


class Act(msgspec.Struct, frozen=True, omit_defaults=True):
    """Ask co for these tasks, in this order. `clauses`, `instead`, `sure`: as of an Option."""

    tasks: tuple[AnyCommand, ...]
    clauses: tuple[Clause, ...] = ()
    instead: bool = False
    sure: bool = False


class Ask(msgspec.Struct, frozen=True, omit_defaults=True):
    """Ask back, or refuse and say what would be understood: then there are no options.

    `sentences`: further answers, each a sentence that is understood without the question.
    """

    text: str
    options: tuple[Option, ...] = ()
    sentences: tuple[str, ...] = ()


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
    if meaning.hints == Hints():
        return _outcome(meaning, context)
    return _hinted(meaning, context)


def _outcome(meaning: Meaning, context: Context) -> Outcome:
    """The outcome of a sentence by its clauses."""
    meaning = _without_talk(meaning)
    clauses = _weighty(meaning.clauses)
    if meaning.guessed:
        clauses = tuple(dict.fromkeys(clauses))
    if any(one.does in TASKS for one in clauses) and clauses != meaning.clauses:
        meaning, context = _with_names(meaning, context)
    if corrected := _self_corrected(clauses, context):
        meaning, clauses = replace(meaning, guessed=True), corrected
    wishes = tuple(one for one in clauses if one.does in TASKS)
    if wishes and wishes != clauses:  # and a question, or to cancel
        meaning, clauses = replace(meaning, guessed=True), wishes
    if meaning.partly:  # what is clear in it is likelier than what is not
        known = (one for one in clauses if all(of.kinds or of.ref for of in one.things))
        clauses = tuple(one for one in known if not one.lacks) or clauses
    if not clauses:
        return Ask(_not_understood(meaning))
    if not wishes:
        return _without_task(replace(meaning, clauses=clauses), context)
    whole = {one.does for one in clauses if not one.lacks}
    clauses = tuple(one for one in clauses if not (one.lacks and one.does in whole))
    return _outcome_of_wishes(replace(meaning, clauses=clauses), context)


def _outcome_of_wishes(meaning: Meaning, context: Context) -> Outcome:
    """The outcome of wishes for tasks, and nothing beside them."""
    language, clauses = meaning.language, meaning.clauses
    lacking = [one for one in clauses if one.lacks]
    try:
        if lacking and (chosen := _of_offered(clauses, context)):
            return chosen
        if len(lacking) > 1:
            return Ask(say(language, "lacking", TASKS[lacking[0].does].example[language]))
        if lacking:
            return _complete(meaning, context, lacking[0])
        tasks, plain = _tasks(clauses, context, language)
    except _Doubt as doubt:
        found = _of_offered(clauses, context) if doubt.thing.ref == "it" else None
        return found or _ask_back(meaning, context, doubt)
    unsure = next((clause.unsure for clause in clauses if clause.unsure), "")
    if unsure == EITHER:
        return _either(meaning, context)
    if meaning.guessed or unsure:
        tasks, plain = tuple(dict.fromkeys(tasks)), tuple(dict.fromkeys(plain))
        why = f"{say(language, unsure)} " if unsure else ""
        return Ask(f"{why}{_mean(tasks, language)}", (Option("", tasks, plain),))
    return Act(tasks, plain)


def _without_talk(meaning: Meaning) -> Meaning:
    """A sentence with wishes, without what names no thing beside them; what somebody says to need
    beside a wish only tells what the wish is about.
    """
    if not any(one.does in TASKS for one in meaning.clauses):
        return meaning
    heard = tuple(one for one in meaning.clauses if not _is_small_talk(one))
    if any(one.does in TASKS and one.unsure != EITHER for one in heard):
        heard = tuple(Clause("the", one.things) if one.unsure == EITHER else one for one in heard)
    return replace(meaning, clauses=heard, guessed=meaning.guessed or heard != meaning.clauses)


def _with_names(meaning: Meaning, context: Context) -> tuple[Meaning, Context]:
    """Names beside a wish say what "it" is; one that nobody knows makes the sentence a guess, and
    one behind a wish that is about no thing.
    """
    names = [one.things[0] for one in meaning.clauses if one.does == "the"]
    kinds = [one.kinds for one in names if not one.ref]
    several = [kind_of(name) for name in context.seen or ()]
    clear = [of[0] for of in kinds if len(of) == 1 and several.count(of[0]) < 2]
    lone = any(
        one.does in TASKS and not one.things and behind.does == "the"
        for one, behind in itertools.pairwise(meaning.clauses)
    )
    guessed = meaning.guessed or () in kinds or lone
    context = replace(context, mentioned=with_mentioned(context.mentioned, *clear))
    return replace(meaning, guessed=guessed), context


def _is_small_talk(clause: Clause) -> bool:
    """Whether several words that nobody knows stand beside a wish: they name no thing."""
    thing = clause.things[0] if clause.does == "the" else NamedObject("")
    return not (thing.kinds or thing.ref) and " " in thing.said


def _either(meaning: Meaning, context: Context) -> Act | Ask:
    """Ask which of several wishes is meant: "I need the jar" may ask to bring it or to hand it
    over.
    """
    language, options = meaning.language, []
    if context.options:  # "the bowl please" answers the question
        named = [replace(one, does="the", unsure="") for one in meaning.clauses]
        answer = _outcome_of_a_name(replace(meaning, clauses=tuple(named)), context)
        if len(named) == 1 and isinstance(answer, Act):
            return answer
    first = next(clause.does for clause in meaning.clauses if clause.unsure == EITHER)
    for does in (first, *TASKS[first].alike):
        side = TASKS[does].sided
        clauses = tuple(
            replace(one, does=does, side=one.side if side else "") if one.unsure == EITHER else one
            for one in meaning.clauses
        )
        options.append(Option("", *_tasks(clauses, context, language)))
    return _ask_which(options, language)


def _weighty(clauses: tuple[Clause, ...]) -> tuple[Clause, ...]:
    """The wishes without courtesies, and without names that one of them has, too. Another name
    behind a wish asks for the same with that thing: "take the jar and the bowl".
    """
    wishes: list[Clause] = []
    named = {one.kinds for clause in clauses if clause.does not in LIGHT for one in clause.things}
    for clause in clauses:
        if clause.does not in LIGHT:
            wishes.append(clause)
        elif (
            wishes
            and wishes[-1].things
            and clause.does == "the"
            and clause.things[0].kinds not in named
        ):
            things = (*clause.things, *wishes[-1].things[1:])
            wishes.append(replace(wishes[-1], things=things, side=clause.side))
    names = tuple(one for one in clauses if one.does == "the")
    return tuple(wishes) or names[-1:] or clauses[-1:]


def _mean(tasks: tuple[AnyCommand, ...], language: str) -> str:
    return say(language, "mean", in_words(tasks, language))


def _ask_sentence(sentences: list[str], language: str) -> Ask:
    """Ask which of these sentences is meant; each is understood without the question."""
    return Ask(_quoted(sentences, language), (), tuple(sentences))


def _ask_which(options: list[Option], language: str, why: str = "") -> Ask:
    """Ask which of these wishes is meant, each in words."""
    text = _quoted([in_words(one.tasks, language) for one in options], language)
    return Ask(f"{why} {text}".strip(), tuple(options))


def _quoted(sentences: list[str], language: str) -> str:
    row = "mean" if len(sentences) == 1 else "which_of"
    return say(language, row, sentences[0] if len(sentences) == 1 else " / ".join(sentences))


def _without_task(meaning: Meaning, context: Context) -> Outcome:
    """Return the outcome of a question, an answer and the like, which stand alone."""
    language, clause = meaning.language, meaning.clauses[0]
    if clause.does == "release" and context.options:  # "go on", while a question is open
        return _yes(meaning, context)
    if clause.does in _OF_THE_TALK:
        return _OF_THE_TALK[clause.does](meaning, context)
    if clause.does in ("cancel", "cancel_all") and meaning.guessed:
        return _ask_sentence([say(language, clause.does)], language)
    return Tell(clause.does, clause.task)


def _yes(meaning: Meaning, context: Context) -> Outcome:
    if len(context.options) == 1 and not meaning.guessed:
        return _chosen(context.options[0])
    return Ask(_unasked(meaning.language, context), context.options)


def _chosen(option: Option) -> Act:
    return Act(option.tasks, option.clauses, option.instead, option.sure)


def _no(meaning: Meaning, context: Context) -> Outcome:
    return Ask(say(meaning.language, "not_then")) if context.options else Tell("stop")


def _again(meaning: Meaning, context: Context) -> Outcome:
    """What was done last, once more, if that is meant."""
    return _offer(meaning, context, [context.last])


def _undo(meaning: Meaning, context: Context) -> Outcome:
    """What undoes what was done last; while it is still to be done, it is cancelled."""
    language = meaning.language
    if context.busy:
        return _ask_sentence([say(language, "cancel")], language)
    undone = [
        Clause(undo, one.things[:1])
        for one in reversed(context.last)
        if (undo := TASKS[one.does].undo)
    ]
    if context.last and len(undone) < len(context.last):
        return Ask(say(language, "cannot_undo", _done_last(context, language)))
    return _offer(meaning, context, [tuple(undone)])


def _done_last(context: Context, language: str) -> str:
    return in_words(_tasks(context.last, context, language)[0], language)


def _leave(meaning: Meaning, context: Context) -> Outcome:
    """To put a thing down, or to leave the task: which one is asked."""
    language, named = meaning.language, meaning.clauses[0].things
    thing = named[0] if named else NamedObject("it", ref="it")
    sentences = [say(language, "cancel")]
    try:
        put, _ = _tasks((Clause("put", (thing,)),), context, language)
        sentences.insert(0, in_words(put, language))
    except _Doubt:
        pass
    return _ask_sentence(sentences, language)


def _rather(meaning: Meaning, context: Context) -> Outcome:
    """A correction: what was wished last, with this thing, this hand, or its things exchanged."""
    told = (one for one in meaning.clauses if not any(of.ref == "it" for of in one.things))
    clause = next(told, meaning.clauses[0])
    wishes = []
    for at, one in enumerate(context.last):
        for changed in _corrections(one, clause, context):
            wishes.append((*context.last[:at], changed, *context.last[at + 1 :]))
    if not context.last and len(clause.things) == 1:
        return _outcome_of_a_name(meaning, context)
    return _offer(meaning, context, wishes, instead=True)


def _self_corrected(clauses: tuple[Clause, ...], context: Context) -> tuple[Clause, ...]:
    """The wishes of a sentence that takes back a part of itself: "take the jar, I mean the bowl";
    none where it does not.
    """
    found: list[Clause] = []
    for clause in clauses:
        if clause.does == "rather" and found and found[-1].does in TASKS:
            changes = _corrections(found[-1], clause, context)
            changed = next((one for one in changes if _makes_sense(one, context)), None)
            if changed is None:
                return ()
            found[-1] = changed
        else:
            found.append(clause)
    return tuple(found) if len(found) < len(clauses) else ()


def _makes_sense(clause: Clause, context: Context) -> bool:
    try:
        return bool(_tasks((clause,), context, "en"))
    except _Doubt:
        return False


def _corrections(one: Clause, clause: Clause, context: Context) -> Iterator[Clause]:
    if clause.side and TASKS[one.does].uses and not clause.things:
        yield replace(one, side=clause.side)
    elif not clause.things and len(one.things) > 1:
        yield replace(one, things=one.things[::-1])
    elif clause.things:
        meant = clause.things[-1]
        others = [_object(name) for name in _candidates(context)] if meant.ref else [meant]
        for n, thing in itertools.product(reversed(range(len(one.things))), others):
            yield replace(one, things=(*one.things[:n], thing, *one.things[n + 1 :]))


def _offer(
    meaning: Meaning,
    context: Context,
    wishes: list[tuple[Clause, ...]],
    *,
    instead: bool = False,
) -> Ask:
    """Ask whether one of these wishes is meant; those that make no sense are left out."""
    language, options = meaning.language, []
    before = _done_last(context, language) if context.last else ""
    for clauses in wishes:
        try:
            tasks, plain = _tasks(clauses, context, language)
        except _Doubt:
            continue
        once = len(set(tasks)) == len(tasks)
        if tasks and once and not (instead and in_words(tasks, language) == before):
            options.append(Option("", tasks, plain, instead))
    if not options:
        return Ask(say(language, "nothing_before"))
    return _ask_which(options, language)


def _complete(meaning: Meaning, context: Context, lacking: Clause) -> Ask:
    """Ask for what was left out of a wish, or is not clear in it: the things that it may be."""
    language, uses = meaning.language, TASKS[lacking.does].uses
    offered = [_object(name) for name in _candidates(context)]
    choices = [[thing] for thing in lacking.things] + [offered] * (len(uses) - len(lacking.things))
    for at, (thing, use) in enumerate(zip(lacking.things, uses, strict=False)):
        try:
            _resolved_object(thing, use, context.mentioned, context.seen, language)
        except _Doubt:
            choices[at] = offered
    options: list[Option] = []
    for things in itertools.product(*choices):
        whole = replace(lacking, things=things, lacks=False, unsure="")
        clauses = tuple(whole if one is lacking else one for one in meaning.clauses)
        names = [one.said for one, of in zip(things, choices, strict=True) if len(of) > 1]
        with contextlib.suppress(_Doubt):
            options.append(Option(names[0] if names else "", *_tasks(clauses, context, language)))
    if sum(len(of) > 1 for of in choices) == 1 and options:
        return _which("", options, language)
    if not options:
        return Ask(say(language, "lacking", TASKS[lacking.does].example[language]))
    return _ask_which(options[:MOST_MENTIONED], language)


def _object(name: str) -> NamedObject:
    """A thing as it is named plainly."""
    return NamedObject(name, (kind_of(name),), int(name.partition("_")[2] or 0))


def _candidates(context: Context) -> tuple[str, ...]:
    """The things that a question may offer: those that were seen, else one of each kind."""
    kinds = tuple(one.name for one in THINGS.values() if one.can)
    seen = tuple(name for name in context.seen or () if kind_of(name) in kinds)
    places = tuple(one for one in kinds if "put" in THINGS[one].can)
    names = seen or tuple(one for one in kinds if one not in places)
    several = [kind_of(name) for name in names]
    plain = (name if several.count(kind_of(name)) > 1 else kind_of(name) for name in names)
    return tuple(dict.fromkeys((*plain, *places)))


def _which(text: str, options: list[Option], language: str) -> Ask:
    if len(options) == 1:
        question = _mean(options[0].tasks, language)
    elif options:
        names = ", ".join(noun(option.thing, language) for option in options)
        question = say(language, "which", names)
    else:
        question = _nearest("", language)
    return Ask(f"{text} {question}".strip(), tuple(options))


def _outcome_of_a_name(meaning: Meaning, context: Context) -> Outcome:
    """Return the outcome of a thing's name alone: the option offered under that name, or the first
    wish for a thing.
    """
    options = {
        option.thing: option
        for option in context.options
        if option.thing or len(context.options) == 1
    }
    clause = meaning.clauses[0]
    thing = clause.things[-1]
    name = f"{thing.kinds[0]}_{thing.number}" if thing.number else "".join(thing.kinds[:1])
    if name not in options and thing.number == 1:  # "the jar one"
        name = thing.kinds[0]
    plain = (
        not (thing.quality or thing.ref or thing.doubt or meaning.guessed) and len(thing.kinds) == 1
    )
    if plain and name in options:
        return _chosen(options[name])
    fitting = [one for one in context.options if _is_about(one, name)]
    if plain and len(fitting) == 1:
        return _chosen(fitting[0])
    said = (thing.quality or thing.said).split()
    numbers = CATALOGUE.ordinal[meaning.language]
    place = next((numbers[word] for word in said if word in numbers), 0)
    if 0 < place <= len(context.options) > 1:
        return _chosen(context.options[place - 1])
    if not (thing.kinds or thing.ref):
        return Ask(_not_understood(replace(meaning, why="sorry", strange=thing.said)))
    if context.last and clause.does == "the" and not context.options:
        return _rather(meaning, context)
    return outcome(
        replace(meaning, clauses=(Clause(_FIRST, (thing,), clause.side),), guessed=True), context
    )


def _is_about(option: Option, name: str) -> bool:
    """Whether one of its tasks is about a thing, or a place."""
    return name in {of for task in option.tasks for of in task.task.arguments}


def _of_offered(clauses: tuple[Clause, ...], context: Context) -> Act | None:
    """The only wish among those that are offered that is asked for in the same way: "bring it"."""
    wanted = [clause.does for clause in clauses]
    fitting = [one for one in context.options if [of.does for of in one.clauses] == wanted]
    return _chosen(fitting[0]) if len(fitting) == 1 else None


_FIRST = next(
    name for name, wish in TASKS.items() if wish.offer is Offer.THINGS and len(wish.uses) == 1
)


def _unasked(language: str, context: Context) -> str:
    if not context.options:
        return say(language, "nothing_asked")
    if not all(one.thing for one in context.options):
        return _ask_which(list(context.options), language).text
    return say(language, "which", ", ".join(noun(one.thing, language) for one in context.options))


def _not_understood(meaning: Meaning) -> str:
    """A refusal, with the nearest thing that can be done."""
    language = meaning.language
    first = say(language, "sorry")
    if meaning.why == "long":
        first = say(language, "long", MOST_CHARACTERS, MOST_WORDS)
    elif meaning.why == "many":
        first = say(language, "many", MOST_WISHES)
    elif meaning.strange:
        first = say(language, "strange", meaning.strange)
    return f"{first} {_nearest(meaning.near, language)}"


def _nearest(does: str, language: str) -> str:
    if does:
        return say(language, "nearest", TASKS[does].example[language])
    some = [row.phrases.wish[0].example[language] for row in commands.rows()][:MOST_EXAMPLES]
    return say(language, "some", ", ".join(map(repr, some)))


# --- hints ----------------------------------------------------------------------------------------

MOST_OFFERED = 4  # wishes in a question (estimate)
_VERB, _ALIKE, _NAMED, _NEAR, _SURE = 4, 3, 2, 3, 7
"""Weights of a word that hints at a wish, or at one that is alike, and of a thing that is named;
how much less than the best wish one is offered still; from which sum on a wish is meant rather than
what cannot be done (estimates).
"""


class _Offer(NamedTuple):
    """Wishes that may be meant, and how well they fit the words."""

    fits: int
    clauses: tuple[Clause, ...]


def _hinted(meaning: Meaning, context: Context) -> Outcome:
    """The outcome of a sentence that is not understood without doubt: a question with the wishes
    at which it hints, an answer, or a refusal with the reason.
    """
    language, of = meaning.language, meaning.hints
    ones = [one for one in meaning.clauses if one.does in TASKS]
    if of.side and len(ones) == 1 and not ones[0].side and TASKS[ones[0].does].sided:
        handed = tuple(
            replace(one, side=of.side) if one is ones[0] else one for one in meaning.clauses
        )
        meaning = replace(meaning, clauses=handed, guessed=True)
    plain = replace(meaning, hints=Hints())
    if meaning.guessed and not context.mentioned:  # "I need the box, can you reach it"
        named = [it.thing for one in of.parts for it in (*one.mentions, *of.named)]
        names = (it.kinds[0] for it in named if len(it.kinds) == 1 and _good_for("take", it))
        context = replace(context, mentioned=with_mentioned((), *names))
    read = _outcome(plain, context)
    asked = isinstance(read, Ask) and bool(read.options or read.sentences)
    unsure = any(clause.unsure for clause in meaning.clauses) and not meaning.partly
    corrects = any(
        before.does in TASKS and after.does == "rather"
        for before, after in itertools.pairwise(meaning.clauses)
    )
    if isinstance(read, Act) or (asked and (unsure or corrects or _of_before(meaning, context))):
        return read
    wishes = any(clause.does in TASKS for clause in meaning.clauses)
    talk = of.talk or ("see" if of.asks and not wishes else "")
    if talk and not (asked and not meaning.guessed):
        return _without_task(replace(plain, clauses=(Clause(talk),), guessed=True), context)
    fits, options = _offered_wishes(of, context, language)
    no_goal = _no_goal(of, language)
    why = say(language, of.cannot) if of.cannot else ""
    able = any(
        (one.does and not one.cannot and (one.mentions or _alone(one)))
        or ((one.does or not one.cannot) and any(it.thing.kinds for it in one.mentions))
        for one in of.parts
    )
    things = [thing for clause in meaning.clauses for thing in clause.things]
    wished = all(clause.does in TASKS for clause in meaning.clauses)
    plain_read = wished and not meaning.guessed and all(one.kinds for one in things)
    if asked and able and plain_read:
        return read
    if (of.cannot and not able) or (no_goal and fits < _SURE):
        nearest_wish = TASKS.get(NEAR.get(of.cannot, ""))
        near = nearest_wish.example[language] if nearest_wish else ""
        one = next((one for one in options if len(one.tasks) == 1), None)
        near = in_words(one.tasks, language) if one else near
        nearest = say(language, "nearest", near) if near else _nearest("", language)
        return Ask(f"{why or no_goal} {nearest}")
    if asked and wishes:
        options = _beside_read(read, options, of, named=not any(one.ref for one in things))
    elif fits < _NAMED or (isinstance(read, Tell) and fits < _VERB + _NAMED):
        options = []
    if why and not options and not asked:
        return Ask(f"{why} {_nearest('', language)}")
    if not options:
        lacking = _lacking(of)
        if not lacking or asked or not isinstance(read, Ask):
            return read
        return _complete(replace(plain, clauses=(lacking,)), context, lacking)
    return _ask_which(options, language, why)


def _alone(part: Part) -> bool:
    """Whether a part hints at a wish that needs no thing."""
    return any(TASKS[does].offer is Offer.ALONE for does in part.does)


def _of_before(meaning: Meaning, context: Context) -> bool:
    """Whether a sentence is read as what changes the last wish, or answers a question."""
    does = {clause.does for clause in meaning.clauses} - {"greet", "yes", "no"}
    return bool(context.last or context.options) and does <= {"the", "rather"}


def _beside_read(
    read: Outcome, options: list[Option], hints: Hints, *, named: bool
) -> list[Option]:
    """The wishes that are offered where the grammar read some in a part of the sentence: none where
    it read all of them. `named`: it read no "it" or "that" as a thing.
    """
    ones = read.options if isinstance(read, Ask) else ()
    mentions = (of for part in hints.parts for of in part.mentions if of.role in ("", "to"))
    kinds = {of.thing.kinds[0] for of in mentions if len(of.thing.kinds) == 1}
    whole = all(
        kinds <= {kind_of(name) for task in one.tasks for name in task.task.arguments if name}
        for one in ones
    )
    if not ones or (whole and (named or not options)):
        return []
    told = [one.tasks for one in options]
    if told == [one.tasks for one in ones]:  # the grammar's question says what is not clear
        return []
    if len(ones) > 1 or ones[0].tasks in told:
        return options
    return [*options[: MOST_OFFERED - 1], *ones]


def _lacking(hints: Hints) -> Clause | None:
    """The wish of which only one verb was said."""
    hinted = {part.does for part in hints.parts if len(part.does) == 1 and not part.mentions}
    does = next((one for one, wish in TASKS.items() if (one,) in hinted and wish.lacking), None)
    return Clause(does, lacks=True) if does else None


def _no_goal(hints: Hints, language: str) -> str:
    """The sentence on something that nothing can be put into; "" where there is none."""
    for part in hints.parts:
        goals = [one.thing for one in part.mentions if one.role == "to"]
        things = [one.thing for one in part.mentions if one.role == "" and one.thing.kinds]
        fits = any(_good_for("pour", one) for one in things) or not things
        if any(_good_for("put", one) or (fits and _good_for("pour", one)) for one in goals):
            continue
        kind = next((kind for one in goals for kind in one.kinds), "")
        if kind and things:
            return say(language, "cannot_put", noun(kind, language, 2))
    return ""


def _offered_wishes(hints: Hints, context: Context, language: str) -> tuple[int, list[Option]]:
    """The wishes at which a sentence hints, the likeliest first, and how well that one fits."""
    found, firsts = list[_Offer](), list[_Offer]()
    elsewhere, verbs = hints.named, tuple[str, ...]()
    for part in hints.parts or (Part(mentions=hints.named),):
        verbs = part.does or verbs
        whole = replace(part, does=verbs)
        handed = (_with_hand(one, hints.side) for one in _offers(whole, elsewhere, context))
        offers = sorted(handed, key=lambda one: -one.fits)
        found += offers
        firsts += [one for one in offers[:1] if one.fits > _VERB and part.does]
        elsewhere += part.mentions
    found.sort(key=lambda one: -one.fits)
    if len(firsts) > 1:
        together = tuple(clause for one in firsts for clause in one.clauses)
        found.insert(0, _Offer(found[0].fits, together[:MOST_WISHES]))
    fits, options = 0, dict[str, Option]()
    for one in found:
        for tasks, plain in _made_clear(one.clauses, context, language):
            fits = fits or one.fits
            once = len(set(tasks)) == len(tasks)
            if once and one.fits >= fits - _NEAR and len(options) < MOST_OFFERED:
                options.setdefault(in_words(tasks, language), Option("", tasks, plain))
    return fits, list(options.values())


def _offers(part: Part, elsewhere: tuple[Mention, ...], context: Context) -> Iterator[_Offer]:
    """Yield the wishes that a part of a sentence may mean, with the things that it names; where a
    wish wants more of them, with those that are known.
    """
    kept = [one for one in part.mentions if one.role != "except"]
    left_out = [kind for one in part.mentions if one not in kept for kind in one.thing.kinds]
    goals = [one.thing for one in kept if one.role == "to"]
    things = [one.thing for one in kept if one.role != "to" and one.thing.kinds]
    if not any(_good_for("take", one) for one in things):
        things += [
            one.thing for one in elsewhere if one.thing.kinds and _good_for("take", one.thing)
        ][-1:]
    things = things or [one.thing for one in kept if one.thing.ref and one.role != "to"]
    if not things and len(goals) > 1:  # "what is in the jar into the bowl"
        things, goals = goals[:1], goals[1:]
    known = [_object(name) for name in _candidates(context) if kind_of(name) not in left_out]
    alike = {other for does in part.does for other in TASKS[does].alike}
    for does, wish in TASKS.items():
        verb = _VERB if does in part.does else _ALIKE if does in alike else 0
        if wish.offer is Offer.ALONE or not wish.uses:
            yield from [_Offer(verb + _NAMED, (Clause(does),))] if verb else ()
            continue
        firsts = [one for one in things if _good_for(wish.uses[0], one)]
        many = [one for one in firsts if one.doubt == "many" or one.ref == "both"]
        each = [one for one in known if any(_is_one_of(one, it) for it in many)]
        firsts = each or firsts
        if len(wish.uses) == 1:
            score = verb + _NAMED - bool(goals)
            if (verb or (each and not wish.held)) and 1 < len(firsts) <= MOST_WISHES:
                yield _Offer(score, tuple(Clause(does, (one,)) for one in firsts))
            for one in firsts if verb or not wish.held else ():
                yield _Offer(score, (Clause(does, (one,)),))
            continue
        seconds = [one for one in goals if _good_for(wish.uses[1], one)]
        if wish.uses[0] == wish.uses[1] and len(firsts) > 1 and not seconds:
            firsts, seconds = firsts[:1], firsts[1:]
        if not (seconds or (verb and firsts and not goals)) or (things and not firsts):
            continue
        fits = verb + _NAMED * (bool(firsts) + bool(seconds)) - (not (firsts and seconds))
        if 1 < len(firsts) <= MOST_WISHES and seconds:
            together = tuple(Clause(does, (one, seconds[0])) for one in firsts)
            yield _Offer(fits + _NAMED, together)
        firsts = firsts or [one for one in known if _good_for(wish.uses[0], one)]
        seconds = seconds or [one for one in known if _good_for(wish.uses[1], one)]
        for pair in itertools.product(firsts, seconds):
            yield _Offer(fits, (Clause(does, pair),))


def _with_hand(offer: _Offer, side: str) -> _Offer:
    """The wishes with a hand where one of them can have it, which fits better then."""
    clauses = [
        replace(one, side=side) if side and TASKS[one.does].sided else one for one in offer.clauses
    ]
    return _Offer(offer.fits + (tuple(clauses) != offer.clauses), tuple(clauses))


def _is_one_of(thing: NamedObject, many: NamedObject) -> bool:
    """Whether a thing that is known is one of those that a plural means."""
    movable = any("take" in THINGS[kind].can for kind in thing.kinds)
    return movable and (not many.kinds or bool({*thing.kinds} & {*many.kinds}))


def _good_for(use: str, thing: NamedObject) -> bool:
    """Whether a thing may be good for a use, as far as its name tells."""
    kinds = [THINGS[kind] for kind in thing.kinds]
    return any(use in kind.can for kind in kinds) or (bool(thing.ref) and use == "take")


def _made_clear(
    clauses: tuple[Clause, ...], context: Context, language: str
) -> Iterator[tuple[tuple[AnyCommand, ...], tuple[Clause, ...]]]:
    """Yield the tasks of wishes; where a thing is not clear, with each that it could be."""
    try:
        yield _tasks(clauses, context, language)
    except _Doubt as doubt:
        if doubt.thing.ref == "it":
            return
        known = {kind_of(name) for name in _candidates(context)}
        for name in [one for one in doubt.names if kind_of(one) in known] or doubt.names:
            clear = _with_thing(clauses, doubt.thing, _object(name))
            with contextlib.suppress(_Doubt):
                yield _tasks(clear, context, language)


def _with_thing(
    clauses: tuple[Clause, ...], unclear: NamedObject, thing: NamedObject
) -> tuple[Clause, ...]:
    """The wishes with a thing that is known in place of one that is not clear."""
    return tuple(
        replace(one, things=tuple(thing if it is unclear else it for it in one.things))
        for one in clauses
    )


# --- things ---------------------------------------------------------------------------------------


def _tasks(
    clauses: tuple[Clause, ...], context: Context, language: str
) -> tuple[tuple[AnyCommand, ...], tuple[Clause, ...]]:
    """The tasks of all clauses, and the clauses with the names of their things; what one of them
    names, the next one can call it.
    """
    tasks: list[AnyCommand] = []
    plain: list[Clause] = []
    mentioned, last = context.mentioned, Clause("")
    for clause in clauses:
        both = last.does in TASKS and TASKS[last.does].uses == ("pour", "pour")
        if both and clause.does in _TO_ONE and clause.things and clause.things[0].ref == "it":
            # "pour the jar into the bowl and give it to me": the full one, or the one in the hand
            raise _Doubt(clause.things[0], "", mentioned[1::-1])
        last = clause
        uses = TASKS[clause.does].uses[: len(clause.things)]
        named = zip(clause.things, uses, strict=True)
        names = tuple(
            _resolved_object(thing, use, mentioned, context.seen, language) for thing, use in named
        )
        if len(set(zip(names, uses, strict=True))) < len(names):
            raise _Doubt(
                clause.things[1], say(language, f"itself_{uses[1]}", noun(names[1], language))
            )
        tasks.append(MAKE[clause.does](names, clause.side))
        things = tuple(map(_object, names))
        plain.append(Clause(clause.does, things, clause.side))
        mentioned = with_mentioned(mentioned, *names)
    return tuple(tasks), tuple(plain)


_TO_ONE = {does for one, wish in TASKS.items() if wish.alike for does in (one, *wish.alike)}
"""Wishes for a thing that is to be in a hand, or at hand."""


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
    thing: NamedObject,
    use: str,
    mentioned: tuple[str, ...],
    seen: tuple[str, ...] | None,
    language: str,
) -> str:
    """The name of a thing as pl takes it. Raise _Doubt where it is not clear which one is meant;
    any place will do.
    """
    fit = tuple(one.name for one in THINGS.values() if use in one.can)
    if thing.ref:
        return _referred(thing, use, mentioned, fit, language)
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
    several = tuple(f"{kind}_{n}" for n in range(1, 10) if f"{kind}_{n}" in (seen or ()))
    there = several if len(several) > 1 else possible
    if thing.doubt == "many":
        raise _Doubt(thing, say(language, "one"), there)
    if thing.doubt == "like":
        raise _Doubt(thing, "", there)
    unseen = seen is not None and use != "put" and f"{kind}_{thing.number}" not in seen
    if thing.doubt == "none" or (thing.number and unseen):
        raise _Doubt(thing, say(language, "no_such", thing.said), there)
    if not thing.number and len(several) > 1 and use != "put":
        raise _Doubt(thing, "", several)
    return f"{kind}_{thing.number}" if thing.number else kind


def _referred(
    thing: NamedObject, use: str, mentioned: tuple[str, ...], fit: tuple[str, ...], language: str
) -> str:
    """The thing that a word such as "it" stands for."""
    if thing.ref == "both":
        raise _Doubt(thing, say(language, "one"), fit)
    if thing.ref == "this":
        raise _Doubt(thing, "", thing.kinds or fit)
    at = 0 if thing.ref == "it" else 1
    meant = thing.kinds or fit
    known = tuple(name for name in mentioned if kind_of(name) in fit and kind_of(name) in meant)
    if use == "put" and mentioned and kind_of(mentioned[0]) not in fit:
        known = ()  # "put the box on the table and the bowl on it": on the box
    if len(known) <= at:
        raise _Doubt(thing, say(language, "name_it", thing.said), thing.kinds or fit)
    return known[at]


def _ask_back(meaning: Meaning, context: Context, doubt: _Doubt) -> Ask:
    """The question, with an option for each thing that would make the sentence clear; where none
    would, with another wish that these things are good for: "put the jar into the bowl".
    """
    language, options = meaning.language, list[Option]()
    if not doubt.names:
        for does, wish in TASKS.items():
            clauses = tuple(
                replace(one, does=does) if doubt.thing in one.things else one
                for one in meaning.clauses
            )
            wanted = next(one for one in clauses if doubt.thing in one.things)
            if wish.offer is Offer.THINGS and len(wish.uses) == len(wanted.things) > 1:
                with contextlib.suppress(_Doubt):
                    options.append(Option("", *_tasks(clauses, context, language)))
    for name in doubt.names:
        clauses = _with_thing(meaning.clauses, doubt.thing, _object(name))
        with contextlib.suppress(_Doubt):
            tasks, plain = _tasks(clauses, context, language)
            if len(set(tasks)) == len(tasks):
                options.append(Option(name, tasks, plain))
    if not options and doubt.names and len(meaning.clauses) == 1:  # more than one is not clear
        return _complete(meaning, context, meaning.clauses[0])
    return _which(doubt.text, options, language)


_OF_THE_TALK: dict[str, Callable[[Meaning, Context], Outcome]] = {
    "the": _outcome_of_a_name,
    "yes": _yes,
    "no": _no,
    "again": _again,
    "undo": _undo,
    "leave": _leave,
    "rather": _rather,
}
"""Sentences about what was said before."""


# --- tasks ----------------------------------------------------------------------------------------


def in_words(tasks: tuple[AnyCommand, ...], language: str = "en") -> str:
    """Return a sentence from which the same tasks are understood."""
    return say(language, "then").join(commands.in_words(task, language) for task in tasks)


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


def wishes(context: Context, held: Collection[str] = ()) -> tuple[Wish, ...]:
    """The sentences that could be said now, without a thing, then thing by thing in the order in
    which the things were told; `held`: the things in the hands.
    """
    things = _offered_objects(context)[:MOST_THINGS]
    return tuple(
        Wish(
            does,
            InWords(noun(name, "en"), noun(name, "pl")) if name else InWords("", ""),
            InWords(in_words((task,)), in_words((task,), "pl")),
        )
        for name in ("", *things)
        for does, task in _offered(name, things, held)
    )


def _offered(
    name: str, things: tuple[str, ...], held: Collection[str]
) -> Iterator[tuple[str, AnyCommand]]:
    """Yield what can be done with a thing, and others beside it, or without one: the name of the
    wish, and the task.
    """
    in_hand = {*held, *map(kind_of, held)} if name else held
    for does, wish in TASKS.items():
        if wish.held is not None and wish.held is not (name in in_hand if name else bool(held)):
            continue
        if wish.offer is Offer.ALONE and not name:
            yield does, MAKE[does]((), "")
        if wish.offer is Offer.THINGS and name:
            beside = [one for one in things if one != name]
            others = itertools.permutations(beside, len(wish.uses) - 1)
            for names in ((name, *rest) for rest in others):
                if all(
                    use in THINGS[kind_of(one)].can
                    for one, use in zip(names, wish.uses, strict=True)
                ):
                    yield does, MAKE[does](names, "")


def replies_to(
    options: tuple[Option, ...], language: str, sentences: tuple[str, ...] = ()
) -> tuple[str, ...]:
    """Return the sentences that answer a question: "yes" for the only option, else the name of each
    or the wish in words; further ones, and "no"; none where it is none.
    """
    names = [_reply_to(one, language) if len(options) > 1 else YES[language] for one in options]
    return (*names, *sentences, NO[language]) if names or sentences else ()


def _reply_to(option: Option, language: str) -> str:
    return noun(option.thing, language) if option.thing else in_words(option.tasks, language)


def _offered_objects(context: Context) -> tuple[str, ...]:
    """The things that something is offered for, the only one of its kind without a number."""
    uses = {wish.uses[0] for wish in TASKS.values() if wish.offer is Offer.THINGS}
    known = [name for name in context.seen or () if kind_of(name) in THINGS]
    seen = tuple(name for name in known if uses & {*THINGS[kind_of(name)].can})
    kinds = [kind_of(name) for name in seen]
    named = tuple(name if kinds.count(kind_of(name)) > 1 else kind_of(name) for name in seen)
    mentioned = (name for name in context.mentioned if kind_of(name) not in kinds)
    return tuple(dict.fromkeys((*named, *mentioned)))
