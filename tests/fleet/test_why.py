"""`roco why` and `roco trace` on whole stories of the fleet: the true cause of each end, from step
logs alone.
"""

import pytest
from logged_fleet import LoggedFleet

from operate.tracing.trace import Known
from services.human_interface.device_messages import Sentence
from services.human_interface.grammar import understand

POUR = "pour the content of the jar into the bowl"


@pytest.fixture
def fleet(tmp_path):
    """A fleet whose steps are logged."""
    with LoggedFleet(tmp_path) as made:
        yield made


def told(why, title):
    """The sentences of a passage; [] where there is none."""
    passages = {one.title: one.facts for one in why.passages}
    return [fact.text for fact in passages.get(title, ())]


def running(fleet, act):
    """Go on until the oldest task that has not ended is in this act."""

    def begun():
        running = (task for task in fleet.tasks if task.state == "running")
        return any(task.at and act in task.at.id for task in running)

    fleet.until(begun)


def test_a_thing_that_is_not_there(fleet):
    """The end has the planner's reason, and is followed back over pl to what the person asked."""
    fleet.world.poses.pop("jar_1")
    fleet.say(POUR)
    assert fleet.finish() == ["failed"]
    why = fleet.reasons()
    ended, asked = told(why, "how it ended"), told(why, "why these plans")
    assert "co said failure to hi: failed: jar has not been seen" in ended[0]
    assert ended[1].startswith("because pl said failure to co: no plan: jar has not been seen")
    assert ended[-2].startswith("because hi said request to co: pour into jar bowl")
    assert "hi was told from outside" in ended[-1]
    assert asked[-1].startswith("pl found no plan 1: jar has not been seen")


def test_a_cancel(fleet):
    """The end is followed back through ta and ex to the person's cancel."""
    fleet.say(POUR)
    running(fleet, "grasp")
    fleet.cancel()
    assert fleet.finish() == ["cancelled"]
    ended = told(fleet.reasons(), "how it ended")
    chain = ["ta said inform to co: Preempted", "co said cancel to ta", "hi said cancel to co"]
    places = [next(n for n, text in enumerate(ended) if link in text) for link in chain]
    assert places == sorted(places)
    assert "hi was told from outside" in ended[-1]


@pytest.mark.parametrize("agent", ["pl", "ta"])
def test_an_agent_that_was_killed(fleet, agent):
    """It is told that it was away, and, where its act was lost, why the plan was made again."""
    fleet.say(POUR)
    running(fleet, "grasp" if agent == "ta" else "")
    fleet.wires.kill(agent, restart_s=2.0)
    assert fleet.finish() == ["done"]
    texts = told(fleet.reasons(), "who was away")
    assert any(text.startswith(f"{agent} was gone") for text in texts)


def test_a_task_that_was_left(fleet):
    """The scheduler's decision with its numbers, when it was left, put aside and taken up; the
    urgent one has none.
    """
    fleet.say(POUR)
    running(fleet, "grasp")
    urgent_wish = "look around"
    fleet.wires.post("hi", Sentence("urgent", urgent_wish, understand(urgent_wish), urgency=1))
    assert fleet.finish(2) == ["done", "done"]
    first, urgent = (task.task for task in fleet.tasks)
    waited = told(fleet.reasons(first), "waiting and switching")
    decision = "left for another task, look around: it is more urgent"
    assert [text.partition(":")[0] for text in waited] == [
        "co took it", "co asked ta to leave the plan", "co put it aside", "co took it up again",
    ]  # fmt: skip
    assert waited[1] == f"co asked ta to leave the plan: {decision}"
    assert waited[2] == f"co put it aside: {decision}"
    texts = told(fleet.reasons(urgent), "waiting and switching")
    assert texts == ["co took it: tasks that come before it: 1: pour jar, bowl: under way"]


def test_what_each_agent_does_for_a_task_stands_below_it(fleet):
    """Of two tasks at once, each has its plans, its queries and its acts; every link is from a step
    log.
    """
    fleet.say(POUR)
    fleet.say("look around")
    assert fleet.finish(2) == ["done", "done"]
    trace = fleet.traced().trace
    for task in (one for one in trace.roots if one.initiator == "hi"):
        below = [span for _, span in trace.below(task)][1:]
        pairs = {(span.initiator, span.participant) for span in below}
        assert pairs >= {("co", "pl"), ("co", "ta"), ("ta", "ex")}
        plans = {span.messages[0].text for span in below if span.participant == "pl"}
        assert plans == {"ground task network"}
        assert {span.known for span in below} == {Known.STEP}
        for span in below:
            assert task.start <= span.start
            (parent,) = [one for one in trace.spans if one.id == span.parent]
            assert parent.participant == span.initiator
    roots = {(one.initiator, one.protocol) for one in trace.roots}
    assert roots == {("hi", "request"), ("km", "subscribe")}  # the first look is for km's sake
