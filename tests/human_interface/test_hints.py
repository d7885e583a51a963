"""Sentences that no pattern fits: what they hint at is offered, answered or refused with a reason,
and never done.
"""

import re
from pathlib import Path

from hypothesis import example, given, settings
from hypothesis import strategies as st

from companion.stop_words import forms, stop_words
from services.human_interface.catalogue import CATALOGUE, LANGUAGES, TASKS, WISHES, say
from services.human_interface.grammar import understand
from services.human_interface.interpretation import (
    MOST_OFFERED,
    Act,
    Ask,
    Context,
    Tell,
    in_words,
    outcome,
)

SEEN = Context(seen=("jar_1", "bowl_1", "box_1", "table_1"))
HINTED = [does for does, wish in TASKS.items() if wish.hint]
FEW = settings(max_examples=60, deadline=None)
PLACING = {
    "en": (
        ["", "my sister rang, ", "since it rained, ", "the neighbours are loud, and "],
        {"the jar": "jar", "the bowl": "bowl", "the box": "box"},
        ["belongs", "hops happily", "xyz", "ought to be"],
        {"on the table": "table", "to the cabinet": "cabinet"},
    ),
    "pl": (
        ["", "Zosia śpi, ", "pada deszcz, a ", "wiesz co, "],
        {"słoik": "jar", "miska": "bowl", "pudełko": "box"},
        ["ma sobie leżeć", "pójdzie", "xyz", "powinno być"],
        {"na stół": "table", "do szafki": "cabinet"},
    ),
}


def said(sentence, context=SEEN):
    """What comes of a sentence."""
    return outcome(understand(sentence), context)


def offered(found):
    """The tasks of each answer that a question offers."""
    acts = [outcome(understand(one), SEEN) for one in found.sentences]
    return [one.tasks for one in found.options] + [
        one.tasks for one in acts if isinstance(one, Act)
    ]


TABLE = Path(__file__).parent / "sentences/everyday.tsv"
ROWS = [line.split("\t")[2] for line in TABLE.read_text().splitlines() if line[0] != "#"]


@FEW
@example(["Sprzątnij wszystko ze stołu", "zaraz goście przyjdą"], ", ")
@example(["clear the table", "the jar"], ", ")
@given(
    st.lists(st.sampled_from(ROWS), min_size=1, max_size=3),
    st.sampled_from((", ", " and ", " a ", ". ", " bo ")),
)
def test_whatever_is_said_in_a_row_has_an_outcome(parts, between):
    """With nothing seen yet, and after a look around."""
    for context in (Context(), SEEN):
        assert said(between.join(parts), context)


def test_a_name_behind_a_wish_without_things_is_asked_about():
    """Only one of both can be meant."""
    assert isinstance(said("clear the table"), Act)
    for more in ("the jar", "xyz", "and the bowl"):
        assert isinstance(said(f"clear the table, {more}"), Ask), more


@FEW
@given(st.sampled_from(LANGUAGES), st.data())
def test_the_place_that_was_said_is_in_the_first_wish_that_is_offered(language, data):
    """Whatever verb stands there, and whatever is said beside it."""
    talk, thing, verb, goal = (data.draw(st.sampled_from([*of])) for of in PLACING[language])
    _, things, _, goals = PLACING[language]
    sentence = f"{talk}{thing} {verb} {goal}"
    found = said(sentence)
    wishes = [found.tasks] if isinstance(found, Act) else offered(found)
    first = wishes[0][0]
    assert (first.object, first.place) == (things[thing], goals[goal]), sentence


@FEW
@given(
    st.sampled_from([one for one in TASKS if TASKS[one].hint]),
    st.sampled_from(LANGUAGES),
    st.data(),
)
def test_a_hint_is_no_act_and_offers_few_wishes_that_are_understood(does, language, data):
    """Each phrase with a thing and words that nobody knows."""
    phrase = data.draw(st.sampled_from([*forms(TASKS[does].hint[language])]))
    thing = {"en": "the bowl", "pl": "miskę"}[language]
    sentence = f"blorp {phrase.rstrip('*')} {thing} zzq frobnicate"
    found = said(sentence)
    assert not isinstance(found, Act), sentence
    if isinstance(found, Ask):
        assert len(found.options) + len(found.sentences) <= MOST_OFFERED
        for text in found.sentences:
            one = said(text)
            assert isinstance(one, Tell) or in_words(one.tasks, language) == text, sentence


def test_no_hint_has_a_stop_word():
    """The robot stops before such a sentence is read."""
    rows = [one.hint for one in WISHES if one.hint]
    rows += [{"en": one.en, "pl": one.pl} for one in CATALOGUE.cannot]
    phrases = [
        phrase.rstrip("*")
        for texts in rows
        for language in LANGUAGES
        for phrase in forms(texts[language])
    ]
    assert [one for one in phrases if stop_words(f"velma can {one} zzq")] == []


def test_what_cannot_be_done_is_said_with_what_can():
    """In the language of the sentence, with a sentence that is understood as an act."""
    for row in CATALOGUE.cannot:
        for language, texts in (("en", row.en), ("pl", row.pl)):
            sentence = next(
                one
                for one in (f"{form.rstrip('*')} kxq" for form in forms(texts))
                if not stop_words(one) and understand(one).language == language
            )
            found = said(sentence)
            assert isinstance(found, Ask), sentence
            assert not found.options, sentence
            assert found.text.startswith(say(language, row.says)), sentence
            (near,) = re.findall(r"'([^']+)'", found.text.removeprefix(say(language, row.says)))
            assert isinstance(said(near), Act), sentence


CANNOT = ["close the cabinet", "take the lid off the jar", "put the lid back on the jar",
          "phone my daughter", "szafkę otwórz", "ugotuj mi rosół"]  # fmt: skip
BESIDE = ["jar in the cabinet and shut the door", "put the box on the table, then make me some tea"]


def test_a_wish_beside_what_cannot_be_done_is_offered():
    """And what cannot is said as well; alone it is refused."""
    for sentence in CANNOT:
        found = said(sentence)
        assert isinstance(found, Ask), sentence
        assert found.options + found.sentences == (), sentence
    for sentence in BESIDE:
        assert offered(said(sentence))[0][0].says.startswith("place"), sentence


ANSWERED = {
    "whereabouts is my bowl then": "see", "gdzie podziała się moja miska": "see",
    "how many jars would you say": "see", "is the cabinet shut love": "doors",
    "czy szafka jest zamknięta, bo stąd nie widzę": "doors", "why've you stopped": "why",
    "what's that you're holding": "hands", "how much longer will it be now": "how_long",
    "czemu stanęłaś": "why", "co ty właściwie potrafisz": "help",
}  # fmt: skip


def test_questions_are_answered_in_any_words():
    """By what they begin with."""
    assert {one: said(one).does for one in ANSWERED} == ANSWERED


def test_a_wish_wins_over_small_talk_and_questions_beside_it():
    """What is offered is the wish."""
    for sentence in ("never mind the mess, the jar goes in the cabinet",
                     "where did I put my glasses, well bring me over the jar then",
                     "I forgot why I came, anyway the jar should be in the cabinet"):  # fmt: skip
        assert "jar" in offered(said(sentence))[0][0].task.arguments, sentence


def test_several_seen_things_are_offered_together():
    """A plural of two to four that were seen; without those that are excepted."""
    seen = Context(seen=("jar_1", "jar_2", "bowl_1", "box_1", "table_1"))
    found = outcome(understand("all of the jars onto the table now please"), seen)
    assert in_words(found.options[0].tasks).count("jar") == 2
    found = outcome(understand("everything except the box over to the table"), seen)
    assert "box" not in in_words(found.options[0].tasks)
    assert in_words(found.options[0].tasks).count("put the") == 3


def test_cancelling_in_other_words_is_asked():
    """With the sentence that cancels."""
    for sentence in ("forget about the bowl, I've got it myself", "on second thoughts no need",
                     "nieważne z tym pudełkiem", "rozmyśliłam się jednak"):  # fmt: skip
        assert said(sentence).sentences[0] in ("cancel", "anuluj"), sentence


POLISH = ["najpierw jednak słoik", "posprzątaj po śniadaniu", "ty głupia maszyno", "ale pięknie",
          "pozniej mi nasypiesz", "jeszcze raz to samo"]  # fmt: skip


def test_polish_is_answered_in_polish():
    """Also where no thing is known."""
    assert [one for one in POLISH if understand(one).language != "pl"] == []
    assert understand("stop the blorp").language == "en"
