"""`roco why` of the Robot Companion on a recorded pour: plans and beliefs, as what was said has
them.
"""

import json
import re
from pathlib import Path

import pytest
from typer.testing import CliRunner

from companion.languages import hfsm, rc
from companion.tools.why import _ends
from console.__main__ import app

pytestmark = pytest.mark.usefixtures("answered_here")
POUR = Path(__file__).parents[2] / "histories" / "pour_seed_7"


def asked(*words):
    """Return the verb's JSON output about this run."""
    done = CliRunner().invoke(app, [*words, "--run", str(POUR), "--format", "json"])
    assert done.exit_code == 0, done.stderr
    return json.loads(done.stdout)


def told(why, title):
    """The sentences of a passage."""
    facts = next(one["facts"] for one in why["passages"] if one["title"] == title)
    return [fact["text"] for fact in facts]


def test_why_two_plans():
    """The first one says that it ends with a new plan and ended so, with the reason; the second one
    succeeded.

    The newest task is meant where none is named.
    """
    why = asked("why")
    assert why == asked("why", "hi-1-1")
    plans, went = told(why, "why these plans"), told(why, "how they went")
    wanted = [text for text in plans if text.startswith("co asked")]
    assert wanted == [f"co asked pl for plan {number}: pour jar bowl" for number in (1, 2)]
    text = "pl found plan 1 with 91 answers of km, to take 48 s: take jar, carry jar, take bowl"
    assert text in plans[1]
    assert went[0].startswith("ta ended plan 1 with Replan after 11 acts: ")
    assert went[1].startswith("ta ended plan 2 with Succeeded after 2 acts")


def test_a_plain_sentence_comes_first():
    """As the robot tells it: what was asked for, what became of it, why; of a thing where it is."""
    sentence = "Done: pour the content of the jar into the bowl. It took 75 seconds."
    assert asked("why")["sentence"] == sentence
    done = CliRunner().invoke(app, ["why", "--run", str(POUR)])
    assert done.stdout.startswith(f"{sentence}\n\n")
    assert asked("why", "jar", "--at", "30")["sentence"] == "My left hand holds the jar."
    assert asked("why", "bowl", "--at", "12")["sentence"] == "I see where the bowl is now."


def test_no_amount_is_told_with_more_digits_than_people_read():
    """Of no thing, at no time."""
    for thing in ("jar", "bowl", "cabinet_2"):
        for at in ("12", "30", "60", "85"):
            for fact in asked("why", thing, "--at", at)["passages"][0]["facts"]:
                assert not re.search(r"\d\.\d{4}", fact["text"]), fact


def test_what_is_believed_of_a_thing_is_what_ask_answers():
    """The place, the time since when, and the observer are the same in both."""
    query = (
        "SELECT ?where ?since WHERE { GRAPH ?said { thing:jar_1 roco:isIn ?where } ?said"
        " roco:toldAt ?since }"
    )
    (row,) = asked("ask", query, "--at", "12")["results"]["bindings"]
    why = asked("why", "jar_1", "--at", "12")
    facts = why["passages"][0]["facts"]
    at = next(n for n, fact in enumerate(facts) if "it is in cabinet 2" in fact["text"])
    assert facts[at]["at"] - why["begin"] == pytest.approx(float(row["since"]["value"]), abs=0.002)
    assert facts[at]["record"] == "C6 ta > km inform, id object/jar_1@1.8"
    told = "ta told km so (object/jar_1); ex had reported it at the end of “look”"
    assert facts[at + 1]["text"].startswith(told)


def test_beliefs_change():
    """In the hand it is in no cabinet; after the pour its content is in the bowl; before a look
    nothing is believed.
    """
    held = str(asked("why", "jar", "--at", "30"))
    assert "the left hand holds it" in held
    assert "it is in cabinet" not in held
    assert "its content is in bowl" in str(asked("why", "jar"))
    done = CliRunner().invoke(app, ["why", "jar", "--at", "3", "--run", str(POUR)])
    assert (done.exit_code, "is no task of this run" in done.stderr) == (2, True)


def test_an_end_that_only_a_failure_reaches_is_told_as_one():
    """A plan that has another way for an act that fails is not to end so."""
    failing = hfsm.Arc(hfsm.Outcome.FAILED, "failed")
    look = hfsm.ActState(
        "look", rc.Look(key="k", at=()), arcs=(failing, hfsm.Arc(hfsm.Outcome.SUCCEEDED, "replan"))
    )
    outcomes = {"failed": hfsm.Outcome.FAILED, "replan": hfsm.Outcome.REPLAN}
    ends = tuple(hfsm.EndState(name, outcome) for name, outcome in outcomes.items())
    said = list(_ends(hfsm.Machine("root", "look", (look, *ends))))
    assert said == ["the plan ends, if an act fails, with failed", "the plan is to end with replan"]
