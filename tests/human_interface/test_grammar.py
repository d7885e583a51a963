"""The command language: from the words of a sentence to what hi does."""

import itertools
import re
import sys
from collections import Counter
from pathlib import Path

import pytest
from hypothesis import Phase, example, given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from companion import commands
from companion.design import CMD
from companion.languages.cmd import BACK, Command
from companion.languages.cmd import THINGS as THINGS_NAMED
from companion.models import MODELS
from companion.sentences import Reader, catalogue, noun
from companion.stop_words import stop_words
from companion.tasks.pour.command import PourInto
from companion.tasks.put_down.command import PutDown
from companion.tasks.take.command import Take
from services.human_interface import grammar
from services.human_interface.catalogue import CATALOGUE, LANGUAGES, SAY, THINGS, WISHES, abilities
from services.human_interface.catalogue import say as hi_says
from services.human_interface.grammar import VOCABULARY, understand
from services.human_interface.interpretation import (
    Act,
    Ask,
    Context,
    Option,
    Tell,
    in_words,
    outcome,
    replies_to,
    with_mentioned,
)

TABLES = Path(__file__).parent / "sentences"
VERBS = {row.content: row.phrases.wish[0].can["en"].split()[0] for row in commands.rows()}
NO_TASK = {"cancel_all": "cancel", "cancel": "cancel", "stop": "stop", "release": "ask"}
FEW = settings(
    max_examples=25, deadline=None, phases=(Phase.explicit, Phase.generate, Phase.shrink)
)  # a sentence takes 20 ms, and some of the tests have several
# calls and returns of the worst sentence; the worst that was found has 2.1 million
MOST_CALLS = 5_000_000
UNDERSTOOD_OF_OURS = 0.95
UNDERSTOOD_OF_OTHERS = 0.5
names = st.sampled_from(("jar", "bowl", "jar_2"))
FIELDS = {
    "side": st.sampled_from(("", "left", "right")),
    "place": st.sampled_from(("", BACK, "table", "table_2", "cabinet")),
}


def commands_of(content):
    """Commands of a class: fields without a default are things, and two of them differ."""
    needed = content.__struct_fields__[
        : len(content.__struct_fields__) - len(content.__struct_defaults__)
    ]
    things = {
        name: names if name in needed else st.one_of(st.just(""), names) for name in THINGS_NAMED
    }
    fields = [name for name in content.__struct_fields__ if name not in Command.__struct_fields__]
    made = st.builds(content, **{name: (FIELDS | things)[name] for name in fields})
    return made.filter(lambda one: len(set(one.things)) == len(one.things))


tasks = st.one_of([commands_of(row.content) for row in commands.rows()])


def calls(work):
    """Return how many functions `work` calls, those written in C included."""
    count = itertools.count()
    sys.setprofile(lambda *_: next(count))
    try:
        work()
    finally:
        sys.setprofile(None)
    return next(count)


def said(sentence, context=None):
    """Return the result of a sentence that stops nothing, without the clauses it was read as."""
    found = outcome(understand(sentence), context or Context())
    if isinstance(found, Act):
        return Act(found.tasks)
    if isinstance(found, Ask):
        return replace(found, options=tuple(replace(one, clauses=()) for one in found.options))
    return found


def short(meaning, context):
    """What comes of a sentence, as in the tables: the word that people ask for a task with, and
    what it is about; a word before what is not done at once. No difference is made between a table
    and any place.
    """
    later = "later " if meaning.when.later_s or meaning.when.at else ""
    found = outcome(meaning, context)
    if isinstance(found, Ask):
        return f"{later}ask"
    if isinstance(found, Tell):
        return later + NO_TASK.get(found.does, "answer")
    return later + named(found.tasks)


def rows(table):
    """Yield rows (wanted result, actual result, sentence) of a table."""
    for line in (TABLES / table).read_text().splitlines():
        if not line.startswith("#"):
            want, before, text = line.split("\t")
            context = Context(mentioned=tuple(re.findall(r"\w+", before)))
            yield want, "stop" if stop_words(text) else short(understand(text), context), text


@pytest.mark.timeout(240)
@pytest.mark.parametrize(
    ("table", "least", "part"),
    [("tuned.tsv", 150, UNDERSTOOD_OF_OURS), ("held_out.tsv", 75, UNDERSTOOD_OF_OTHERS)],
)
def test_sentences_of_a_table_end_as_a_person_would_want(table, least, part):
    """Whether the language was made for them or not: done, asked back, or refused with what can be
    done.

    None becomes another act, and the robot stops where a person would want it, and only there.
    Which of the held-out ones end otherwise is not shown.
    """
    found = list(rows(table))
    assert len(found) >= least
    acts = set(VERBS.values())
    assert [row for row in found if row[0] != row[1] and row[1].split()[0] in acts] == []
    assert [row for row in found if (row[0] == "stop") != (row[1] == "stop")] == []
    right = [want == got for want, got, _ in found]
    assert sum(right) >= part * len(right), f"{sum(right)} of {len(right)}"


def named(tasks):
    """Tasks as the tables write them."""
    words = (
        (VERBS[type(one)], *(of for of in one.task.arguments if of not in ("", "table")))
        for one in tasks
    )
    return "; ".join(map(" ".join, words))


def talk(sentences, context):
    """The outcome of the last sentence (None: a stop), and the context after it."""
    found = None
    for text in sentences:
        texts = [of for one in LANGUAGES for of in replies_to(context.options, one)]
        found = None if stop_words(text, texts) else outcome(understand(text), context)
        if isinstance(found, Act):
            things = [name for task in found.tasks for name in task.things]
            mentioned = with_mentioned(context.mentioned, *things)
            context = Context(mentioned, seen=context.seen, last=found.clauses)
        elif found is not None:
            context = replace(context, options=getattr(found, "options", ()))
    return found, context


def classed(want, before, text):
    """How the sentence ends: "right", "asked" (what is wanted is among the answers), "refused",
    "in vain" (asked, without it), "stopped" or "other act".
    """
    context = Context()
    if before and set(re.findall(r"\w+", before)) <= {*THINGS, "jar_2"}:
        context = Context(mentioned=tuple(re.findall(r"\w+", before)))
    elif before:
        _, context = talk([before], context)
    found, context = talk([text], context)
    offered = []
    if found is None:
        got = "stop"
    elif isinstance(found, Act):
        got = named(found.tasks)
    elif isinstance(found, Tell):
        got = NO_TASK.get(found.does, "answer")
    else:
        offered = [named(one.tasks) for one in found.options]
        acts = [outcome(understand(one), context) for one in found.sentences]
        offered += [named(one.tasks) if isinstance(one, Act) else "cancel" for one in acts]
        got = "ask" if offered else "refuse"
    if got == want or want in offered:
        return "right" if got == want else "asked"
    if got in ("ask", "refuse", "stop"):
        return {"ask": "in vain", "refuse": "refused", "stop": "stopped"}[got]
    return "other act" if got.split()[0] in VERBS.values() else "refused"


@pytest.mark.timeout(240)
def test_everyday_speech_is_understood_or_usefully_asked_about():
    """No act but the one that is wanted."""
    lines = (TABLES / "everyday.tsv").read_text().splitlines()
    found = [(classed(*line.split("\t")), line) for line in lines if line[0] != "#"]
    assert [line for how, line in found if how == "other act"] == []
    count = Counter(how for how, _ in found)
    assert count["right"] + count["asked"] >= 0.9 * len(found), count
    assert count["refused"] <= 0.05 * len(found), count


@pytest.mark.parametrize("language", LANGUAGES)
@FEW
@example([PourInto("jar_2", "bowl")] * grammar.MOST_WISHES, "!")
@given(
    st.lists(tasks, min_size=1, max_size=grammar.MOST_WISHES), st.sampled_from(("", ".", "!", " "))
)
def test_tasks_in_words_are_understood_as_themselves(language, wanted, end):
    """The words hi uses for tasks are understood as the same tasks: in_words has an inverse."""
    sentence = in_words(tuple(wanted), language) + end
    if len(sentence) <= grammar.MOST_CHARACTERS:
        assert said(sentence) == Act(tuple(wanted))
        assert said(sentence.upper()) == Act(tuple(wanted))


POLITE = st.sampled_from(
    ("", "please ", "Could you please ", "Velma, ", "hello robot, can you ", "I want you to ")
)


@FEW
@given(POLITE, tasks, st.sampled_from(("", ", please", " please?", ", thank you!", " now")))
def test_politeness_changes_nothing(before, wanted, after):
    """Before and after."""
    assert said(before + in_words((wanted,)) + after) == Act((wanted,))


@FEW
@given(st.text(max_size=600))
def test_whatever_is_said_gets_a_wish_or_a_polite_refusal(text):
    """Total; and what becomes a command fits its language and its 250 bytes."""
    found = said(text)
    if isinstance(found, Ask):
        assert found.text
    elif isinstance(found, Act):
        assert all(len(CMD.encode(task)) < 150 for task in found.tasks)


@FEW
@given(
    st.lists(st.sampled_from(sorted(VOCABULARY)), max_size=12),
    st.integers(0, 12),
    st.sampled_from(["spoon", "qx", "łyżka"]),
)
def test_a_sentence_with_a_word_that_nobody_knows_is_no_act(words, at, strange):
    """Salads of our own words with a foreign one: a question at most."""
    assert not isinstance(said(" ".join([*words[:at], strange, *words[at:]])), Act)


@FEW
@given(st.lists(st.sampled_from(sorted(VOCABULARY)), max_size=12))
def test_acts_are_about_known_things_alone(words):
    """Salads of our own words never name a thing that is none."""
    found = said(" ".join(words))
    for task in found.tasks if isinstance(found, Act) else ():
        fields = ("source", "destination", "object")
        named = [getattr(task, one).partition("_")[0] for one in fields if hasattr(task, one)]
        assert all("take" in THINGS[name].can for name in named)
        place = getattr(task, "place", "").partition("_")[0]
        assert place in ("", BACK) or "put" in THINGS[place].can


WORST = (
    "x" * 10_000, "the " * 50, "and the jar " * 40, "it " * 60, "take the jar and " * 11, ", " * 99,
    "to the red jar " * 13, "jar, " * 25, "take it, " * 17,
)  # fmt: skip


def test_the_worst_sentence_is_read_with_bounded_work():
    """Calls are counted, so that load changes nothing; two million take 0.06 s on a quiet machine
    (measured).
    """
    for sentence in WORST:
        for cut in (grammar.MOST_CHARACTERS, len(sentence)):
            assert calls(lambda text=sentence[:cut]: said(text)) < MOST_CALLS, sentence[:20]
    assert understand("take " * (grammar.MOST_WORDS + 1)).why == "long"


# --- asking back ----------------------------------------------------------------------------------


ALL = {"jar", "bowl", "box", "lid"}
UNCLEAR = [
    ("take the spoon", ALL),
    ("take the container", {"jar", "bowl"}),
    ("take it", ALL),
    ("take the red jar", {"jar"}),
    ("pour the milk into the bowl", {"jar"}),
    ("weź łyżkę", ALL),
    ("take the table", set()),
    ("put the jar on the sofa", {"table", "cabinet"}),
    ("put the jar on the left table", {"table"}),
    ("put the spoon into the cabinet", ALL),
    ("put the jar into the bowl", {""}),
    ("włóż słoik do lodówki", {"table", "cabinet"}),
    ("pour the jar into the jar", set()),
]


def test_a_thing_that_is_not_clear_is_asked_about():
    """With the things that it could be, and those only that the sentence makes sense with."""
    for sentence, offered in UNCLEAR:
        found = said(sentence)
        assert isinstance(found, Ask), sentence
        assert {option.thing for option in found.options} == offered, sentence


PLACES = [
    ("put the jar down", ""),
    ("put the jar on the table", "table"),
    ("put the jar in the cupboard", "cabinet"),
    ("put the jar on table 2", "table_2"),
    ("put the jar back", BACK),
    ("odłóż słoik", ""),
    ("postaw słoik na stole", "table"),
    ("schowaj słoik do szafki", "cabinet"),
    ("odłóż słoik na stół 2", "table_2"),
    ("odłóż słoik na miejsce", BACK),
]


def test_a_place_is_only_where_one_was_named():
    """Else it is wherever there is room; several tables are one place, since any of them will
    do.
    """
    seen = Context(seen=("jar_1", "table_1", "table_2"))
    for sentence, place in PLACES:
        assert said(sentence, seen) == Act((PutDown("jar", place),)), sentence


def test_two_things_of_a_kind_are_told_apart_by_number():
    """Two of a kind can be named once a look around told of both."""
    found = said("take the jar", Context(seen=("jar_1", "jar_2", "bowl_1")))
    assert [option.thing for option in found.options] == ["jar_1", "jar_2"]
    assert "jar 1, jar 2" in found.text
    assert said("take the bowl", Context(seen=("jar_1", "jar_2", "bowl_1"))) == Act((Take("bowl"),))


OPTIONS = tuple(Option(name, (Take(name),)) for name in ("jar", "bowl", "box"))


def test_an_answer_to_a_question_is_taken():
    """Yes, where there is one option; else its name."""
    for sentence, count in (
        ("yes", 1),
        ("tak", 1),
        ("the jar", 2),
        ("jar", 2),
        ("I mean the jar", 3),
    ):
        assert said(sentence, Context(options=OPTIONS[:count])) == Act((Take("jar"),)), sentence


def test_a_need_is_asked_about_and_the_answer_may_be_short():
    """Bring it, hand it over or take it: the verb alone, its place among the answers, or no."""
    found, context = talk(["I need the jar"], Context())
    assert [named(one.tasks) for one in found.options] == ["bring jar", "give jar", "take jar"]
    for answer, wanted in (("hand it over", "give jar"), ("the second one", "give jar"),
                           ("bring it", "bring jar"), ("take the jar", "take jar")):  # fmt: skip
        assert named(talk([answer], context)[0].tasks) == wanted, answer
    assert talk(["no"], context)[0] == Ask(hi_says("en", "not_then"))
    assert isinstance(talk(["yes"], context)[0], Ask)


def test_a_sentence_that_takes_back_a_part_of_itself_is_asked_about():
    """With the part that stays; and what "it" is after a pour is asked, too."""
    for sentence, wanted in (
        ("take the jar, I mean the bowl", "take bowl"),
        ("take the jar, no, sorry, with the left hand", "take jar left"),
        ("weź słoik, to znaczy miskę", "take bowl"),
        ("pour the jar into the bowl and give it to me", "pour jar bowl; give bowl"),
        ("słoik i miskę do szafki", "put jar cabinet; put bowl cabinet"),
    ):
        found = said(sentence)
        assert isinstance(found, Ask), sentence
        assert wanted in [named(one.tasks) for one in found.options], sentence


def test_an_answer_to_no_question_moves_nothing():
    """Nor does a yes that could mean several."""
    for found in (said("yes"), said("yes", Context(options=OPTIONS[:2])), said("jar")):
        assert isinstance(found, Ask)


def test_no_is_an_answer_where_something_was_asked_and_else_a_stop():
    """In doubt, stop."""
    assert said("no", Context(options=OPTIONS[:1])) == Ask(hi_says("en", "not_then"))
    assert said("no") == said("nie") == Tell("stop")


def test_a_slip_is_asked_about_and_never_done():
    """With the sentence that it may have been."""
    for sentence, near in (
        ("por the jar into the bowl", "pour the content of the jar into the bowl"),
        ("take the bowll", "take the bowl"),
    ):
        found = said(sentence)
        assert isinstance(found, Ask)
        assert repr(near) in found.text
        assert said("yes", Context(options=found.options)) == said(near)


def test_a_refusal_names_what_is_understood():
    """Something that can be said as it is written there."""
    for sentence in ("dance", "", "make tea and dance", "…", "x" * 10_000, "clean the windows"):
        named = re.findall(r"'([^']+)'", said(sentence).text)
        assert any(isinstance(said(one), Act) for one in named), sentence


# --- the catalogue --------------------------------------------------------------------------------


def test_things_are_those_of_the_models():
    """Takeable things are moveable, poured ones have an opening, and places to put things have
    surfaces; all are classes of models, and a place has its words in both languages.
    """
    for thing in CATALOGUE.thing:
        models = [model for model in MODELS.values() if model.kind.lower().startswith(thing.name)]
        assert bool(models) is not bool(thing.covers), thing.name
        fit = {
            "take": any(model.moveable for model in models),
            "pour": any(model.moveable and model.hole for model in models),
            "put": any(not model.moveable and model.surfaces for model in models),
        }
        assert {use: use in thing.can for use in fit} == fit, thing.name
        for language in LANGUAGES:
            words = catalogue(Reader(language))
            assert (thing.name in words.place) is ("put" in thing.can), thing.name
            if not thing.covers:  # the same noun in all that is said
                word, cases = noun(thing.name, Reader(language)), 3 if language == "pl" else 1
                forms = tuple(format(word, str(case)) for case in range(cases))
                assert getattr(thing, language)[:cases] == forms, thing.name


def test_both_languages_say_the_same():
    """Each row of a language has its row in the other, with as many blanks."""
    english, polish = (SAY[language] for language in LANGUAGES)
    assert english.keys() == polish.keys()
    assert [row for row in english if english[row].count("{") != polish[row].count("{")] == []
    assert all(getattr(row, language) for row in WISHES for language in LANGUAGES)


@pytest.mark.parametrize("language", LANGUAGES)
def test_what_is_offered_is_understood(language):
    """The list of what can be said, with things in place of X and Y."""
    for offer in re.sub(r" ?\[.*?\]", "", abilities(language)).split("; "):
        jar, bowl = ("jar", "bowl") if language == "en" else ("słoik", "miska")
        sentence = offer.replace("X", jar).replace("Y", bowl)
        assert not isinstance(said(sentence), Ask), sentence
