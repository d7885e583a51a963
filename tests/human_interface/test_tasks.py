"""What a task brings for people is whole: sentences in both languages, and a row in the design."""

import pytest

from companion import commands
from companion.all_languages import CMD
from companion.commands import Offer
from companion.design import DESIGN
from companion.languages import hfsm
from companion.languages.cmd import Command, TaskReport
from companion.letters import fold
from companion.stop_words import stop_words
from services.human_interface.catalogue import CATALOGUE, LANGUAGES, MAKE, SAY, TASKS, THINGS, can
from services.human_interface.grammar import understand
from services.human_interface.wishes import Act, Ask, Context, in_words, outcome

WISHES = [pytest.param(row, wish, id=wish.does) for row, wish in commands.wishes()]


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize(("row", "wish"), WISHES)
def test_the_example_of_a_wish_is_understood_as_the_command_of_its_task(row, wish, language):
    """And stops nothing."""
    meaning = understand(wish.example[language])
    assert [clause.does for clause in meaning.clauses] == [wish.does]
    found = outcome(meaning, Context())
    assert isinstance(found, Act)
    assert [type(task) for task in found.tasks] == [row.content]
    assert stop_words(wish.example[language]) == ""


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize(("row", "wish"), WISHES)
def test_what_hi_says_of_a_task_is_understood_as_the_same_task(row, wish, language):
    """Of the command that the wish makes of as many things as it has; and it stops nothing."""
    fit = [[name for name, one in THINGS.items() if use in one.can] for use in wish.uses]
    task = MAKE[wish.does](tuple(names[at] for at, names in enumerate(fit)), "")
    said = in_words((task,), language)
    assert outcome(understand(said), Context()) == Act((task,))
    assert stop_words(said) == ""


@pytest.mark.parametrize("language", LANGUAGES)
def test_a_button_is_understood_as_it_is_written(language):
    """Those that need no thing; the others are said by the page's tests."""
    found = [outcome(understand(says), Context()) for says in commands.buttons(language)]
    alone = [MAKE[wish.does]((), "") for _, wish in commands.wishes() if wish.offer is Offer.ALONE]
    assert found == [Act((task,)) for task in alone]


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize(("row", "wish"), WISHES)
def test_a_sentence_that_lacks_something_is_answered_with_the_example(row, wish, language):
    """For each wish with such patterns, in both languages."""
    assert set(wish.lacking) in (set(), set(LANGUAGES))
    for pattern in wish.lacking.get(language, ()):
        words = pattern.replace("[out] [CONTENT] ", "").replace("[CONTENT] ", "").replace(" [HAND]", "")
        first = words.partition("|")[0].strip("()")
        thing = {"en": "jar", "pl": "słoik"}[language]
        found = outcome(understand(f"{first} {thing}" if "THING" in words else first), Context())
        assert isinstance(found, Ask)
        assert wish.example[language] in found.text


@pytest.mark.parametrize(("row", "wish"), WISHES)
def test_each_pattern_names_as_many_things_as_its_command_can_be_made_of(row, wish):
    """Each of them with a use; and there is a task that pl is asked for."""
    for pattern in (*wish.en, *wish.pl):
        count = pattern.count("THING")
        assert count <= len(wish.uses)
        command = MAKE[wish.does](("jar", "bowl")[:count], "")
        assert isinstance(command, row.content)
        assert isinstance(command.task, hfsm.Task)


def test_names_of_wishes_are_of_one_task_each():
    """Else one task would take another one's words away; rows of the other tables are compared when they are read."""
    assert len(TASKS) == len(WISHES)
    assert set(TASKS).isdisjoint(wish.does for wish in CATALOGUE.wish)
    assert all(row.make.keys() == {wish.does for wish in row.phrases.wish} for row in commands.rows())
    ranks = [row.phrases.rank for row in commands.rows()]
    assert len(set(ranks)) == len(ranks), f"two tasks have one rank in phrases.toml: {ranks}; take one that is free"


@pytest.mark.parametrize(("row", "wish"), WISHES)
def test_patterns_have_no_accents(row, wish):
    """Sentences lose theirs before they are compared, so that a pattern with one would never fit."""
    for pattern in (*wish.en, *wish.pl, *(one for patterns in wish.lacking.values() for one in patterns)):
        plain = "".join(sign if sign.isascii() else fold(sign) for sign in pattern)
        assert pattern == plain, f"phrases.toml of {row.content.__name__}: write {plain!r}, without accents"


@pytest.mark.parametrize("language", LANGUAGES)
@pytest.mark.parametrize(("row", "wish"), WISHES)
def test_what_a_command_says_is_a_row_of_its_phrases(row, wish, language):
    """The names in command.py and in phrases.toml are alike."""
    fit = [[name for name, one in THINGS.items() if use in one.can] for use in wish.uses]
    name = MAKE[wish.does](tuple(names[at] for at, names in enumerate(fit)), "").says
    assert name in SAY[language], f"phrases.toml of {row.content.__name__}: [say.{language}] has no row {name!r}"


def test_every_use_has_its_refusal():
    """A thing that is not good for it, and one that is named twice for the same use."""
    for wish in TASKS.values():
        needed = {f"cannot_{use}" for use in wish.uses} | {
            f"itself_{one}" for one in wish.uses if wish.uses.count(one) > 1
        }
        assert all(needed <= SAY[language].keys() for language in LANGUAGES), wish.does


@pytest.mark.parametrize("language", LANGUAGES)
def test_each_task_is_in_the_list_of_what_is_understood(language):
    """In the order of ranks."""
    for row in commands.rows():
        assert any(wish.can and wish.can[language] in can(language) for wish in row.phrases.wish), row.content


def test_the_design_lists_the_command_of_each_task():
    """Rights are stated there: co takes these commands of hi, and none besides."""
    entries = DESIGN.interfaces["commands"].entries
    assert {entry.arguments for entry in entries} == {(f"CMD.{row.content.__name__}",) for row in commands.rows()}
    assert {one for one in CMD.classes if issubclass(one, Command)} == {row.content for row in commands.rows()}
    assert TaskReport in CMD.classes
