"""What a task brings for people is whole: sentences in both languages, and a row in the design."""

import itertools
import re

import pytest

from companion import commands
from companion.commands import Offer
from companion.design import CMD, DESIGN
from companion.languages import hfsm
from companion.languages.cmd import Command, TaskReport
from companion.stop_words import fold, stop_words
from services.human_interface.catalogue import (
    CATALOGUE,
    LANGUAGES,
    MAKE,
    RULES,
    SAY,
    TASKS,
    THINGS,
    abilities,
)
from services.human_interface.grammar import understand
from services.human_interface.interpretation import Act, Ask, Context, in_words, outcome, wishes

WISHES = tuple(commands.wishes())
BOTH = [(row, wish, language) for row, wish in WISHES for language in LANGUAGES]


def whole(wish):
    """The command that a wish makes of as many things as it has."""
    fit = [[name for name, one in THINGS.items() if use in one.can] for use in wish.uses]
    return MAKE[wish.does](tuple(names[at] for at, names in enumerate(fit)), "")


def test_the_example_of_a_wish_is_understood_as_the_command_of_its_task():
    """And stops nothing."""
    for row, wish, language in BOTH:
        example = wish.example[language]
        meaning = understand(example)
        assert [clause.does for clause in meaning.clauses] == [wish.does], example
        found = outcome(meaning, Context())
        assert isinstance(found, Act), example
        assert [type(task) for task in found.tasks] == [row.content], example
        assert stop_words(example) == "", example


def test_what_hi_says_of_a_task_is_understood_as_the_same_task():
    """Whole, by names that are alike in command.py and phrases.toml; and it stops nothing."""
    for row, wish, language in BOTH:
        task = whole(wish)
        where = f"phrases.toml of {row.content.__name__}: [say.{language}] has no row {task.says!r}"
        assert task.says in SAY[language], where
        said = in_words((task,), language)
        found = outcome(understand(said), Context())
        assert isinstance(found, Act), said
        assert found.tasks == (task,), said
        assert stop_words(said) == "", said


@pytest.mark.parametrize("language", LANGUAGES)
def test_a_button_is_understood_as_it_is_written(language):
    """Those that need no thing, with empty hands and full ones; the others are said by the page's
    tests.
    """
    rows = [wish for _, wish in commands.wishes() if wish.offer is Offer.ALONE]
    for held in ((), ("jar_1",)):
        said = [getattr(wish.says, language) for wish in wishes(Context(), held)]
        found = [outcome(understand(says), Context()) for says in said]
        alone = [MAKE[row.does]((), "") for row in rows if row.held in (None, bool(held))]
        assert [one.tasks for one in found] == [(task,) for task in alone]


NAMED = {
    "en": {"AMOUNT": "half of", "TO": "into", "THING": "jar"},
    "pl": {"AMOUNT": "połowę", "TO": "do", "THING": "słoik"},
}


def first_form(pattern, language):
    """The shortest sentence of a pattern: of each choice the first one, with rules at length."""
    known = RULES[language] | NAMED[language]
    while True:
        while group := re.search(r"\[[^\[\]()]*\]|\(([^()\[\]]*)\)", pattern):
            first = (group[1] or "").split("|")[0]
            pattern = pattern[: group.start()] + first + pattern[group.end() :]
        pattern = pattern.split("|")[0]
        if not (rule := re.search(r"\b[A-Z]+(_[A-Z]+)*\b", pattern)):
            return pattern
        pattern = f"{pattern[: rule.start()]}({known[rule[0]]}){pattern[rule.end() :]}"


def test_what_a_sentence_lacks_is_asked_for():
    """For each wish with such patterns, in both languages: each answer is a command of its task."""
    for row, wish, language in BOTH:
        assert set(wish.lacking) in (set(), set(LANGUAGES)), wish.does
        for pattern in wish.lacking.get(language, ()):
            words = first_form(pattern, language)
            found = outcome(understand(words), Context())
            assert isinstance(found, Ask), pattern
            offered = [*(one.tasks for one in found.options)]
            for sentence in found.sentences:
                act = outcome(understand(sentence), Context())
                assert isinstance(act, Act), sentence
                offered.append(act.tasks)
            assert offered, pattern
            assert {type(task) for tasks in offered for task in tasks} == {row.content}, pattern


def test_each_pattern_names_as_many_things_as_its_command_can_be_made_of():
    """Each of them with a use; and there is a task that pl is asked for.

    No pattern has accents: sentences lose theirs before they are compared, so that it would never
    fit.
    """
    for row, wish in WISHES:
        for pattern in (*wish.en, *wish.pl):
            count = pattern.count("THING")
            assert count <= len(wish.uses), pattern
            command = MAKE[wish.does](("jar", "bowl")[:count], "")
            assert isinstance(command, row.content), pattern
            assert isinstance(command.task, hfsm.Task), pattern
        for pattern in itertools.chain(wish.en, wish.pl, *wish.lacking.values()):
            plain = "".join(sign if sign.isascii() else fold(sign) for sign in pattern)
            where = f"phrases.toml of {row.content.__name__}"
            assert pattern == plain, f"{where}: write {plain!r}, without accents"


def test_names_of_wishes_are_of_one_task_each():
    """Else one task would take another one's words away; rows of the other tables are compared when
    they are read.
    """
    assert len(TASKS) == len(WISHES)
    assert set(TASKS).isdisjoint(wish.does for wish in CATALOGUE.wish)
    for row in commands.rows():
        assert row.make.keys() == {wish.does for wish in row.phrases.wish}
    ranks = [row.phrases.rank for row in commands.rows()]
    told = f"two tasks have one rank in phrases.toml: {ranks}; take one that is free"
    assert len(set(ranks)) == len(ranks), told


def test_every_use_has_its_refusal():
    """A thing that is not good for it, and one that is named twice for the same use."""
    for wish in TASKS.values():
        needed = {f"cannot_{use}" for use in wish.uses}
        needed |= {f"itself_{use}" for use in wish.uses if wish.uses.count(use) > 1}
        assert all(needed <= SAY[language].keys() for language in LANGUAGES), wish.does


def test_each_task_is_in_the_list_of_what_is_understood():
    for row in commands.rows():
        for language in LANGUAGES:
            known = abilities(language)
            said = [wish.can[language] for wish in row.phrases.wish if wish.can]
            assert any(one in known for one in said), (row.content, language)


def test_the_design_lists_the_command_of_each_task():
    """Rights are stated there: co takes these commands of hi, and none besides."""
    contents = {row.content for row in commands.rows()}
    arguments = {entry.arguments for entry in DESIGN.interfaces["commands"].entries}
    assert arguments == {(f"CMD.{content.__name__}",) for content in contents}
    assert {one for one in CMD.classes if issubclass(one, Command)} == contents
    assert TaskReport in CMD.classes
