"""`roco say` tells what the coordinator said of a task, and with --wait what became of it."""

import pytest
from typer.testing import CliRunner

from companion.run_files import TaskLine
from companion.tools.verbs import talk
from companion.tools.verbs.hi import HiError
from console.__main__ import app

TAKEN = TaskLine("hi-1-1", "waiting", "next", accepted=True)
RUNS = TaskLine("hi-1-1", "running", "on my way", accepted=True)
DONE = TaskLine("hi-1-1", "done", "held", accepted=True)
REFUSED = TaskLine("hi-1-1", "failed", "busy")
ASKED = TaskLine("hi-1-1", "waiting", "I will take the jar.", "take the jar")


class Answers:
    """In place of hi: what /tasks shows, one after the other, the last one for ever."""

    def __init__(self, said, *shown):
        self.said, self.shown, self.now = said, list(shown), 0.0

    def tasks(self):
        one = self.shown.pop(0) if len(self.shown) > 1 else self.shown[0]
        if isinstance(one, Exception):
            raise one
        return (one,) if isinstance(one, TaskLine) else one

    def monotonic(self):
        return self.now

    def sleep(self, seconds):
        self.now += seconds

    time = monotonic


@pytest.fixture
def say(monkeypatch, tmp_path):
    """Say a sentence to a pretended hi: exit code, standard output, standard error."""

    def said(line, *shown, words=()):
        answers = Answers(line, *shown)
        monkeypatch.setattr(talk, "time", answers)
        monkeypatch.setattr(talk, "_said_when_started", lambda *_: line)
        monkeypatch.setattr(talk, "address", lambda fleet: None)
        monkeypatch.setattr(talk, "Hi", lambda address: answers)
        done = CliRunner().invoke(app, ["say", "take the jar", "--run-dir", str(tmp_path), *words])
        return done.exit_code, done.stdout, done.stderr, answers

    return said


def test_nothing_is_promised_before_the_coordinator_took_it(say):
    """It is waited for; then hi's words count."""
    code, out, err, answers = say(ASKED, ASKED, ASKED, TAKEN)
    assert (code, out, err) == (0, "hi-1-1  waiting  I will take the jar.\n", "")
    assert answers.now > 0.3


def test_a_refusal_by_the_coordinator_is_the_answer(say):
    """Exit code 1, and the reason."""
    code, out, _, _ = say(ASKED, ASKED, REFUSED)
    assert (code, out) == (1, "hi-1-1  failed  busy\n")


@pytest.mark.parametrize("words", [(), ("--wait",)])
def test_a_coordinator_that_says_nothing_is_not_waited_for_for_ever(say, words):
    """The task stays asked for: how to end that is said."""
    code, out, err, answers = say(ASKED, ASKED, words=words)
    assert (code, out) == (1, "")
    assert "has not taken hi-1-1" in err
    assert "roco cancel" in err
    assert answers.now == pytest.approx(talk.TAKEN_S, abs=1.0)


@pytest.mark.parametrize(("end", "code"), [("done", 0), ("failed", 1), ("cancelled", 1)])
def test_waiting_follows_it_to_its_end(say, end, code):
    """Progress on standard error, each state once; the end on standard output and in the exit
    code.
    """
    ended = TaskLine("hi-1-1", end, "the end", accepted=True)
    found, out, err, _ = say(ASKED, TAKEN, RUNS, RUNS, ended, words=("--wait",))
    assert (found, out) == (code, f"hi-1-1  {end}  the end\n")
    assert err.splitlines() == ["hi-1-1  waiting  next", "hi-1-1  running  on my way"]


def test_waiting_outlives_a_hi_that_is_started_again(say):
    """But not for ever."""
    code, out, _, _ = say(
        ASKED, RUNS, HiError(0, "nobody"), HiError(0, "nobody"), RUNS, DONE, words=("--wait",)
    )
    assert (code, out) == (0, "hi-1-1  done  held\n")
    code, _, err, answers = say(ASKED, RUNS, HiError(0, "nobody"), words=("--wait",))
    assert (code, "nobody" in err) == (3, True)
    assert answers.now == pytest.approx(talk.AWAY_S, abs=1.0)


def test_all_wishes_of_a_sentence_are_followed(say):
    """The first that was not done decides."""
    both = TaskLine("hi-1-1", "waiting", "I will", then=("hi-1-2",))
    second = TaskLine("hi-1-2", "done", "poured", accepted=True)
    code, out, _, _ = say(both, (DONE, second), words=("--wait",))
    assert (code, out) == (0, "hi-1-2  done  poured\n")
    failed = TaskLine("hi-1-1", "failed", "slipped", accepted=True)
    code, out, _, _ = say(both, (failed, second), words=("--wait",))
    assert (code, out) == (1, "hi-1-1  failed  slipped\n")


@pytest.mark.parametrize(
    ("state", "code"), [("question", 1), ("refused", 1), ("answered", 0), ("done", 0)]
)
def test_what_is_no_task_is_told_at_once(say, state, code):
    """A question back did nothing yet."""
    assert say(TaskLine("", state, "words"), HiError(500, "never asked"))[:2] == (code, "words\n")
