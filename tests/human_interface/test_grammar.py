"""The grammar of a person's sentences."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.languages import CMD, cmd
from services.human_interface.grammar import (
    EXAMPLES,
    LONGEST_THING,
    UNDERSTOOD,
    CancelTask,
    NotUnderstood,
    TellStatus,
    in_words,
    plain,
    understand,
)

THINGS = ("jar", "bowl", "blue jar", "can", "cup 2", "tea-pot", "toy robo", "hi-fi")
things = st.sampled_from(THINGS)
articles = st.sampled_from(("", "the ", "a ", "my ", "this "))
sides = st.sampled_from(("", "left", "right"))
wishes = st.one_of(
    st.builds(cmd.PourInto, things, things).filter(lambda wish: wish.source != wish.destination),
    st.builds(cmd.Take, things, sides),
    st.builds(cmd.PutDown, things),
    st.just(cmd.LookAround()),
    st.builds(CancelTask, st.sampled_from(("", "hi-1-3"))),
    st.just(TellStatus()),
)
before = st.sampled_from(
    ("", "please ", "Could you please ", "Velma, ", "hello robot, can you kindly ", "I want you to ")
)
after = st.sampled_from(("", ".", "!", ", please", " please?", "  ", ", thank you!"))


@given(wishes, before, after)
def test_a_wish_in_words_is_understood_as_itself_however_polite(wish, before, after):
    """in_words and understand are inverse; politeness and punctuation change nothing."""
    assert understand(before + in_words(wish) + after) == wish
    assert understand((before + in_words(wish) + after).upper()) == wish


@given(
    st.sampled_from(("pour", "pour out")),
    st.sampled_from(("", "the content of ", "content of ", "the contents of ")),
    st.sampled_from(("into", "in")),
    *(articles, things, articles, things),
)
def test_every_form_of_pouring_is_the_same_wish(verb, content, into, first, source, second, destination):
    """Content, article and preposition are the person's taste."""
    wish = understand(f"{verb} {content}{first}{source} {into} {second}{destination}")
    if source == destination:
        assert isinstance(wish, NotUnderstood)
    else:
        assert wish == cmd.PourInto(source, destination)


@given(st.sampled_from(("take", "grab", "bring", "bring me", "get", "pick up")), articles, things, sides)
def test_every_form_of_taking_is_the_same_wish(verb, article, thing, side):
    """A hand may be named."""
    hand = f" with the {side} hand" if side else ""
    assert understand(f"{verb} {article}{thing}{hand}") == cmd.Take(thing, side)


@given(articles, things)
def test_every_form_of_putting_down_is_the_same_wish(article, thing):
    """Down comes before or after."""
    wish = cmd.PutDown(thing)
    assert understand(f"put down {article}{thing}") == wish
    assert understand(f"put {article}{thing} down") == wish
    assert understand(f"put {article}{thing} on the table") == wish


@given(st.text(max_size=600))
def test_whatever_is_said_gets_a_wish_or_a_polite_refusal(text):
    """Total; and what becomes a command fits its language and its 250 bytes."""
    wish = understand(text)
    if isinstance(wish, NotUnderstood):
        assert wish.text
    elif isinstance(wish, cmd.Task):
        assert len(CMD.encode(wish)) < 150


SALAD = ("pour", "take", "put", "down", "jar", "the", "bowl", "into", "with", "left", "hand", "and", "out", "of", "it")


@given(st.lists(st.sampled_from(SALAD)))
def test_no_thing_is_called_by_words_of_the_grammar(words):
    """Salads of the grammar's own words never name a thing that is none."""
    wish = understand(" ".join(words))
    names = [getattr(wish, field, "jar") for field in ("source", "destination", "object")]
    own = {"pour", "take", "put", "into", "with", "and", "of", "the", "it"}
    assert all(name and not own & {name, *name.split()[1:]} for name in names), wish


@pytest.mark.parametrize("example", EXAMPLES)
def test_every_example_is_understood(example):
    """What we tell people to say."""
    assert not isinstance(understand(example), NotUnderstood)


@pytest.mark.parametrize("sentence", ["dance", "", "pour the jar", "make tea and dance", "…", "x" * 10_000])
def test_a_refusal_names_what_is_understood(sentence):
    """Politely, with all forms."""
    refusal = understand(sentence)
    assert isinstance(refusal, NotUnderstood)
    assert UNDERSTOOD in refusal.text


@pytest.mark.parametrize(
    ("sentence", "near"),
    [("por the jar into the bowl", "pour the jar into the bowl"), ("cancle", "cancel"), ("take", "take the jar")],
)
def test_a_slip_is_answered_with_the_nearest_sentence(sentence, near):
    """So that one need not read the list."""
    assert f"Did you mean {near!r}?" in understand(sentence).text


@pytest.mark.parametrize("sentence", ["take it", "take the", "put that down", "take " + "x" * (LONGEST_THING + 1)])
def test_a_thing_needs_a_name(sentence):
    """Pronouns name nothing here."""
    assert isinstance(understand(sentence), NotUnderstood)


def test_a_can_and_a_robot_s_name_are_told_apart():
    """Politeness takes whole phrases only."""
    assert understand("Can you take the can, Velma?") == cmd.Take("can", "")
    assert plain("Hi Velma, cancel hi-1-3!") == "cancel hi-1-3"
