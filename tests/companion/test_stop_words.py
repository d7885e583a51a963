"""Words that stop the robot: found whatever else is said, and never in a plain command."""

import time

import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.stop_words import LONGEST, OPENINGS, PHRASES, WORDS, stop_words

STOPS = """
stop|STOP!!!|Stop it.|please stop|stop stop stop|stooooop
S T O P|s.t.o.p.|stpo|sotp|stp|stopp!|halt|HALT!|freeze|freeeze
emergency stop|e-stop|emergency!|stop the robot|stop moving|can you stop please|robot, stop|Velma stop now
careful|be careful|careful with that|hang on|hang on a second|hold on|hold it|wait|wait a minute|wait, not that one
no don't|no, don’t|dont|do not|don't touch that|don't pour the milk|please don't do that|you must not take it
no no|no no no|no, wait|whoa|woah|watch out|look out!|ouch|that hurts|you are hurting me|it is falling|pause|abort
that's enough|enough|back off|hands off|let go of me|leave me alone|not so fast|slow down|stand still|stay where you are
cut it out|just a second|take the jar, no, stop|pour the jar into the bowl... careful!|don't stop|danger
stój|STÓJ!|stoj|zatrzymaj się|Zatrzymaj to natychmiast|przestań|czekaj|poczekaj chwilę|uważaj|ostrożnie|nie rób tego
nie ruszaj się|nie, nie|dość|wystarczy|chwila|zostaw to|weź słoik, nie, czekaj|nie lej mleka|niebezpiecznie
"""
NO_STOPS = """
take the jar|pour the content of the jar into the bowl|put down the jar|put the jar on the table|look around|cancel
status|take the jar carefully|hold the jar|take the jar and hold it|what do you see?|why have you stopped?|I don't know
never mind|forget it|take the one with the lid|step|the shop|I do not see the jar|why don't you take the jar?|no|now
can't you take the jar|take the jar with the left hand|undo that|what are you waiting for|the bowl, not the jar
weź słoik|postaw słoik na stole|rozejrzyj się|nie wiem|co widzisz?|weź słoik ostrożnie|anuluj|stół|sto
"""


def said(table):
    """The sentences of a table."""
    return [one for one in table.replace("\n", "|").split("|") if one]


@pytest.mark.parametrize("sentence", said(STOPS))
def test_these_stop(sentence):
    """Also in capitals, and in the middle of something else."""
    assert stop_words(sentence)
    assert stop_words(f"  {sentence.upper()}?!")


@pytest.mark.parametrize("sentence", said(NO_STOPS))
def test_these_do_not(sentence):
    """A robot that stopped at its ordinary commands would be of no use."""
    assert stop_words(sentence) == ""


@pytest.mark.parametrize("row", said(WORDS.replace(" ", "|") + PHRASES))
@given(before=st.sampled_from(["take the jar", "please", "słoik", "…"]), after=st.sampled_from(["", " the bowl", "!"]))
def test_every_word_of_the_lists_stops_wherever_it_stands(row, before, after):
    """Each row counts: none is hidden by how sentences are read."""
    assert stop_words(f"{before}, {row}{after}")


@pytest.mark.parametrize("row", said(OPENINGS))
def test_every_opening_stops_at_the_beginning(row):
    """Alone, and before something else."""
    assert stop_words(row)
    assert stop_words(f"{row} the jar")


@given(st.text(max_size=300))
def test_whatever_is_said_is_looked_through(sentence):
    """Total."""
    assert isinstance(stop_words(sentence), str)


@pytest.mark.parametrize(
    "sentence", ["a" * 10**6, "no " * 10**6, "do not " * 10**6, "ﷺ" * LONGEST, "x" * LONGEST + " stop"]
)
def test_the_longest_sentence_takes_no_time(sentence):
    """It is looked through in the thread that listens to people. The bound is an estimate: it takes some ms."""
    begun = time.process_time()
    stop_words(sentence)
    assert time.process_time() - begun < 0.5
