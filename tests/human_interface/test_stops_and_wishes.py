"""Stop words and the catalogue: no wish or question stops the robot, whenever it is meant, however
it is written.
"""

import re

from hypothesis import given, settings
from hypothesis import strategies as st

from companion.stop_words import ROWS, stop_words
from services.human_interface.catalogue import CATALOGUE, LANGUAGES, RULES, WISHES
from services.human_interface.grammar import VOCABULARY

NEVER_READ = {"quit", "stop", "zostaw"}
"""Words of the catalogue's commands that stop the robot; in questions they do not."""
IN_QUESTIONS = {"emergency", "help", "zatrzymac"}
MAY_BE_A_PERSONS = ("let go of my", "let go of our", "zabierz reke")
"""Said of a person's hand as likely as of a thing or the robot's hand: they stop."""
QUESTIONS = ("why", "help", "stopping")
PATTERNS = [
    (row.does, language, one)
    for row in WISHES
    if row.does != "no"
    for language in LANGUAGES
    for one in (*getattr(row, language), *row.lacking.get(language, ()))
]


@st.composite
def sentences(draw):
    """A sentence by the patterns of the catalogue: the row, its language and the words."""
    does, language, pattern = draw(st.sampled_from(PATTERNS))
    return does, language, " ".join(_filled(draw, pattern, language).split())


def _filled(draw, pattern, language):
    """The pattern with each choice made, and the rules that it names in place of their names."""
    while group := re.search(r"[(\[]([^()\[\]]*)[)\]]", pattern):
        choices = group[1].split("|") + ([""] if group[0][0] == "[" else [])
        pattern = pattern[: group.start()] + draw(st.sampled_from(choices)) + pattern[group.end() :]
    pattern = draw(st.sampled_from(pattern.split("|")))
    pattern = pattern.replace("TASK", "hi-1-3")
    return re.sub(r"\b[A-Z_]{2,}\b", lambda name: _rule(draw, name[0], language), pattern)


def _rule(draw, name, language):
    if name in ("THING", "NOUN"):
        forms = [form for thing in CATALOGUE.thing for form in getattr(thing, language)]
        this = draw(st.sampled_from(["", "DET ", "DET QUALITY "])) if name == "THING" else ""
        return _filled(draw, this, language) + draw(st.sampled_from(forms))
    if name in ("COMMA", "NUMBER"):
        return {"COMMA": ",", "NUMBER": "20"}[name]
    if name == "SIDE":
        sides = [side[language].split("|")[0] for side in CATALOGUE.side.values()]
        return draw(st.sampled_from(sides))
    return _filled(draw, RULES[language][name].replace("\n", ""), language)


@st.composite
def times(draw, language):
    """Words that say when, by the expressions of the catalogue."""
    row = draw(st.sampled_from(["within", "by", "later", "at"]))
    text = getattr(CATALOGUE.time[language], row)
    text = re.sub(r"\(\?<?[!=][^)]*\)", "", text).replace("DURATION", CATALOGUE.time[language].part)
    while group := re.search(r"\((\?:)?([^()]*)\)(\??)", text):
        choices = group[2].split("|") + ([""] if group[3] else [])
        text = text[: group.start()] + draw(st.sampled_from(choices)) + text[group.end() :]
    text = draw(st.sampled_from(text.split("|")))
    number = draw(st.sampled_from([*CATALOGUE.number[language], "1", "10", "2.5"]))
    unit = draw(st.sampled_from([*CATALOGUE.unit[language]]))
    text = re.sub(r"\bN\b", number, text).replace("UNIT", unit)
    spoken = ["15:30", "3 pm", "half past one", "one o'clock"]
    clock = draw(st.sampled_from([*CATALOGUE.clock[language], *spoken]))
    return text.replace("CLOCK", clock)


@settings(max_examples=600, deadline=None)
@given(sentence=sentences(), data=st.data())
def test_no_wish_or_question_stops_whenever_it_is_meant(sentence, data):
    """Each pattern of the catalogue, with each form of time before or behind it, and in
    capitals.
    """
    does, language, text = sentence
    if does not in QUESTIONS and set(text.split()) & NEVER_READ:
        return
    if any(hand in text for hand in MAY_BE_A_PERSONS):
        return
    when = data.draw(st.one_of(st.just(""), times(language)))
    forms = [f"{when} {text}", f"{text} {when}", f"{text}, {when}!", f"{text} {when}".upper()]
    text = data.draw(st.sampled_from(forms))
    assert stop_words(text) == "", text


def test_the_words_of_the_catalogue_that_stop_are_known():
    """Another one would make a row of the catalogue that cannot be said."""
    assert {word for word in VOCABULARY if stop_words(f"x {word} x")} == IN_QUESTIONS | NEVER_READ


def test_asides_know_the_nouns_of_the_catalogue():
    """A wish with a noun that stop_words.toml does not have would make no clause an aside."""
    known = {one.strip() for one in re.split(r"[,\n]", ROWS.aside.nouns)}
    nouns = {
        form
        for thing in CATALOGUE.thing
        if thing.name != "thing"  # "something" names no object
        for forms in (thing.en, thing.pl, *thing.many.values())
        for form in forms
    }
    assert {one for one in nouns if known.isdisjoint(one.split())} == set()
