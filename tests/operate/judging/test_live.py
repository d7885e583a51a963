"""live.jsonl: what a person sees while a run goes on."""

from itertools import pairwise

import msgspec
from synthetic import Run

from agent_runtime.io.tap import Sample
from companion.design import DESIGN
from companion.tools.system import SYSTEM
from fipa_codec.communicate import Communicate, encode
from fipa_codec.performatives import Performative
from operate.judging.live import Live
from operate.live_lines import AgentIn, Happened, LiveLine, PlanAt, PlanSeen, Sent, Task
from operate.recording.records import Garbage, Spoken, understood


def lines(run: Run) -> list[LiveLine]:
    """All lines of a run."""
    live = Live(SYSTEM)
    return [line for sample in run.samples for line in live.lines(understood(sample, SYSTEM))]


def test_each_communicate_is_a_line_once(pouring: Run) -> None:
    """Re-sent copies show no second line, and all lines can be read back."""
    live = Live(SYSTEM)
    records = [understood(sample, SYSTEM) for sample in pouring.samples for _ in (1, 2)]
    twice = [line for record in records for line in live.lines(record)]
    sent = [line for line in twice if isinstance(line, Sent)]
    assert len(sent) == len(pouring.said)
    assert [msgspec.json.decode(msgspec.json.encode(line), type=LiveLine) for line in sent] == sent


def test_plans_are_shown_and_followed(pouring: Run) -> None:
    """Each place that ta reports is a state shown for the plan; both plans end with their
    outcome.
    """
    found = lines(pouring)
    shown = {state for line in found if isinstance(line, PlanSeen) for state in line.states}
    places = [line for line in found if isinstance(line, PlanAt)]
    assert {place.at for place in places if place.at} <= shown
    tasks = {line.tasks for line in found if isinstance(line, PlanSeen)}
    assert tasks == {(Task("pour", ("jar", "bowl")),)}
    assert [place.outcome for place in places if place.outcome] == ["replan", "succeeded"]


def test_what_happens_is_told_when_it_happens(pouring: Run) -> None:
    """Each event once, in the order of the story."""
    events = [line for line in lines(pouring) if isinstance(line, Happened)]
    names = [" ".join((line.name, *line.of)) for line in events]
    story = [
        "command-received", "plan-received 1", "grasped jar_1", "put-down bowl_1",
        "poured jar_1 bowl_1", "finished"
    ]  # fmt: skip
    assert [name for name in names if name in story] == story
    assert len(names) == len(set(names))


def test_an_agent_is_told_when_its_state_changes(pouring: Run) -> None:
    """No two lines of an agent in a row say the same."""
    entered = [line for line in lines(pouring) if isinstance(line, AgentIn)]
    for agent in {line.agent for line in entered}:
        states = [(line.state, line.alive) for line in entered if line.agent == agent]
        assert all(a != b for a, b in pairwise(states))


def test_what_was_recorded_shows_no_text_that_is_no_word_or_label() -> None:
    """Records are printed and drawn: a question with a control character in a label is garbage,
    without it none.
    """
    for label, kind in (("pl-1-1", Spoken), ("pl\x1b[2J", Garbage)):
        said = Communicate(
            performative=Performative.QUERY_REF, protocol="query", sender="pl", receiver="km",
            conversation="pl-1-1", id=label,
        )  # fmt: skip
        key = DESIGN.key("velma", said)
        assert type(understood(Sample(key, encode(said), 1.0), SYSTEM)) is kind


def test_who_is_not_heard_is_told_once() -> None:
    """A heartbeat repeats it each second; the line comes once, and again when it happens again."""
    live, found = Live(SYSTEM), []
    one = {"peer": "ta", "channel": "C1", "what": "said", "since": 10.0}
    for at, unheard in ((13.0, [one]), (14.0, [one]), (15.0, []), (23.0, [one | {"since": 20.0}])):
        beat = msgspec.json.encode({"agent": "co", "state": "trigger", "unheard": unheard})
        record = understood(Sample("roco/roco/_/state/co", beat, at), SYSTEM)
        found += [line for line in live.lines(record) if isinstance(line, Happened)]
    assert [line.t for line in found] == [13.0, 23.0]
    assert "what co says to ta on C1 is not received since 3 s" in found[0].text
