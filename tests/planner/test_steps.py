"""pl's agent step by step: what km says, what the search says, and what becomes of the problem of
co.
"""

import pytest
from driven import Driven
from msgspec import Raw
from scripted_search import look, plan_of

from agent_runtime.core.events import Local, Receipted, Started, Tick
from companion.design import wiring
from companion.languages import hfsm, wm
from companion.languages.facts import Kind, fact
from fipa_codec.performatives import Performative as P
from services.planner import behaviours
from services.planner.outgoing_messages import ANSWER_WITHIN_S, DROP_WITHIN_S
from services.planner.search import Answer, Ask, Begin, Died, Found, Stop

SEED = 3
ASKED = wm.ListObjects()
LATER = wm.Unknown((fact(Kind.LOOK_NOT_OVER),), later=True)


def network(name):
    """A task that needs no object."""
    return hfsm.GroundTaskNetwork(name, (hfsm.Task("look_around", ()),))


def asks(one, name):
    """co's problem."""
    one.hears("co", "request", P.REQUEST, network(name), talk=f"co-{name}")


def question(one):
    """The conversation in which km was asked last."""
    return [sent.conversation for sent in one.sends() if sent.receiver == "km"][-1]


def answers(one, content, talk=""):
    """km's word."""
    asks = one.state.soft.asks
    asked = asks[talk or next(iter(asks))].communicate
    unknown = isinstance(content, wm.Unknown | wm.UnknownState)
    act = P.FAILURE if unknown else P.INFORM_REF
    of = {"talk": asked.conversation, "in_reply_to": asked.reply_with}
    one.hears("km", "query", act, content, **of)


def said(one):
    """To whom, performative and content of all that was said in the last step."""
    read = one.core.wiring.languages.read
    return [
        (sent.receiver, sent.performative, read(sent)[0] if sent.content else None)
        for sent in one.sends()
    ]


def fresh():
    """A pl that just came up."""
    one = Driven(behaviours.agent(SEED), wiring("pl", "test"))
    one.step(Started())
    return one


def beginning():
    """A problem was taken; km is asked to forget what was supposed for it before."""
    one = fresh()
    asks(one, "p1")
    first = one.out
    one.step(Receipted("co", taken=1))
    one.out = first
    return one


def searching():
    """The search is under way."""
    one = beginning()
    answers(one, wm.Made("p1"))
    return one


def waiting():
    """The search waits for a fact."""
    one = searching()
    one.step(Local(Ask(1, ASKED)))
    return one


def test_a_problem_is_agreed_to_and_km_forgets_first():
    """Then the search begins, with the seed of this pl, and counted."""
    one = beginning()
    forget = ("km", P.QUERY_REF, wm.DropStates(prefix="p1/"))
    assert said(one) == [("co", P.AGREE, hfsm.Taken("p1")), forget]
    one = searching()
    assert one.tells == [Begin(1, network("p1"), SEED)]
    assert (one.state.memory.ready, one.state.memory.begun) == (True, 1)


def test_a_fact_goes_from_km_to_the_search():
    """Once each way; the question is over then."""
    one = waiting()
    assert said(one) == [("km", P.QUERY_REF, ASKED)]
    answers(one, wm.Objects(()))
    assert one.tells == [Answer(1, wm.Objects(()))]
    assert one.state.memory.soft.question == ""


@pytest.mark.parametrize(
    ("event", "why"),
    [
        (Found(1, hfsm.NoPlan("p1", (fact(Kind.NO_METHOD),))), fact(Kind.NO_METHOD)),
        (Died("exit status 3"), fact(Kind.ENDED, "search")),
    ],
)
def test_a_search_without_a_plan_fails_the_problem(event, why):
    """co is told why, the search is stopped, km forgets; pl is free for the next."""
    one = searching()
    one.step(Local(event))
    (to_co, to_km) = said(one)
    assert to_co[:2] == ("co", P.FAILURE)
    assert to_co[2].why == (why,)
    assert not to_co[2].later
    assert to_km == ("km", P.QUERY_REF, wm.DropStates(prefix="p1/"))
    assert one.tells == [Stop(1)]
    assert (one.state.state, one.state.memory.problem) == ("idle", None)


def test_a_plan_ends_the_search_without_stopping_it():
    """It has ended by itself. What is no longer needed is asked for only once."""
    one = waiting()
    asked = question(one)
    plan = plan_of(network("p1"), [(hfsm.Step("look-around"), [look("jar_1")])])
    one.step(Local(Found(1, plan)))
    assert said(one) == [("co", P.INFORM, plan), ("km", P.QUERY_REF, wm.DropStates(prefix="p1/"))]
    assert one.tells == []
    assert asked not in one.state.soft.asks
    one.now += DROP_WITHIN_S + 0.1
    one.step(Tick())
    assert one.state.soft.asks == {}, "km forgets by itself"


@pytest.mark.parametrize("state", [beginning, waiting])
def test_while_the_world_is_looked_at_the_problem_is_put_off(state):
    """co is told to come again; nothing was supposed, so km has nothing to forget."""
    one = state()
    answers(one, LATER)
    ((to, act, content),) = said(one)
    assert (to, act, content.why, content.later) == ("co", P.FAILURE, LATER.why, True)
    assert one.state.memory == behaviours.Memory(seed=SEED, attempt=one.state.memory.attempt)


@pytest.mark.parametrize("state", [beginning, waiting])
def test_a_km_that_does_not_answer_fails_the_problem(state):
    """Not before the time is over."""
    one = state()
    one.now += ANSWER_WITHIN_S
    one.step(Tick())
    assert [act for to, act, _ in said(one) if to == "co"] == []
    one.now += 0.1
    one.step(Tick())
    ((_, act, content),) = [word for word in said(one) if word[0] == "co"]
    assert act is P.FAILURE
    assert content.why == (fact(Kind.NOT_ANSWERED, "km"),)


@pytest.mark.parametrize("state", [beginning, waiting])
def test_a_km_that_cannot_be_understood_fails_the_problem(state):
    """With its reason."""
    one = state()
    asked = next(iter(one.state.soft.asks.values())).communicate
    rest = {"talk": asked.conversation, "in_reply_to": asked.reply_with}
    rest |= {"content": Raw(b"\xc1"), "language": "WM"}
    one.hears("km", "query", P.INFORM_REF, **rest)
    ((_, act, content),) = [word for word in said(one) if word[0] == "co"]
    assert act is P.FAILURE
    assert content.why == (fact(Kind.BROKE_OFF, "km"),)


def test_hypotheses_lost_begin_the_search_again():
    """As another attempt: words of the one before are ignored."""
    one = waiting()
    answers(one, wm.UnknownState("p1/0"))
    assert said(one) == [("km", P.QUERY_REF, wm.DropStates(prefix="p1/"))]
    assert (one.state.state, one.state.memory.begun) == ("initialize", 2)
    assert not one.state.memory.ready
    answers(one, wm.Made("p1"))
    assert one.tells == [Begin(2, network("p1"), SEED)]
    assert not one.state.memory.soft.lost
    memory = one.state.memory
    plan = plan_of(network("p1"), [(hfsm.Step("look-around"), [look("jar_1")])])
    for word in (Ask(1, ASKED), Found(1, hfsm.NoPlan("p1", ())), Found(1, plan)):
        one.step(Local(word))
    assert one.state.memory == memory


def test_a_restart_begins_the_search_again():
    """The child is gone, and so are km's hypotheses of it."""
    one = searching()
    one.state = one.core.boot(one.core.record(one.state))
    one.step(Started(first=False))
    assert one.state.state == "initialize"
    assert said(one) == [("km", P.QUERY_REF, wm.DropStates(prefix="p1/"))]


def test_a_restart_while_km_is_asked_to_forget_asks_again():
    """The question died with the one before."""
    one = beginning()
    one.state = one.core.boot(one.core.record(one.state))
    one.step(Started(first=False))
    assert ("km", P.QUERY_REF, wm.DropStates(prefix="p1/")) in said(one)
    answers(one, wm.Made("p1"))
    assert one.tells == [Begin(1, network("p1"), SEED)]


def test_problems_are_planned_in_the_order_in_which_they_came():
    """Each is taken when the one before has its answer."""
    one = searching()
    for name in ("p2", "p3", "p4"):
        asks(one, name)
    planned = []
    for _ in range(4):
        problem = one.state.memory.problem.network.id
        planned.append(problem)
        plan = plan_of(network(problem), [(hfsm.Step("look-around"), [look("jar_1")])])
        one.step(Local(Found(one.state.memory.attempt, plan)))
        one.step(Receipted("co", taken=4))
        for asked in tuple(one.state.soft.asks):  # to forget what was supposed, before and after
            answers(one, wm.Made(problem), asked)
    assert planned == ["p1", "p2", "p3", "p4"]
    assert one.state.memory.problem is None


def test_of_several_problems_only_the_cancelled_one_is_forgotten():
    """One that waits, or the one under way: whose search is stopped, whose question is dropped."""
    one = waiting()
    for name in ("p2", "p3"):
        asks(one, name)
    one.hears("co", "request", P.CANCEL, talk="co-p2")
    assert said(one) == [("co", P.INFORM, hfsm.NoPlan("p2", (fact(Kind.CANCELLED),)))]
    assert [waits.network.id for waits in one.state.memory.waiting] == ["p3"]
    asked = one.state.memory.soft.question
    one.hears("co", "request", P.CANCEL, talk="co-p1")
    assert said(one)[0] == ("co", P.INFORM, hfsm.NoPlan("p1", (fact(Kind.CANCELLED),)))
    assert one.tells[0] == Stop(1)
    assert asked not in one.state.soft.asks
    memory = one.state.memory
    assert (memory.problem.network.id, memory.waiting) == ("p3", ())
    assert (memory.attempt, memory.seed) == (1, SEED)
    assert memory.cancelled is False
