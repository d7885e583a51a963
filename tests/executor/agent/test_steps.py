"""ex's agent step by step: each word in each state, told to whom it belongs, and nothing for words
of another act.
"""

import itertools
from typing import Any

import msgspec
import numpy as np
import pytest
from driven import Driven

from agent_runtime.core.events import Event, Local, Started, Tick
from companion.design import wiring
from companion.languages import rc
from companion.languages.facts import Facts, Kind, fact
from companion.languages.values import Pose, Side
from companion.skills.loop_messages import motion
from fipa_codec.performatives import Performative as P
from services.executor import behaviours
from services.executor.behaviours import SKILL_WITHIN_S
from services.executor.device_messages import (
    Brake,
    ByRays,
    Crashed,
    Do,
    Drop,
    Ended,
    Feel,
    Glance,
    GoOn,
    Halt,
    Lost,
    Move,
    Moved,
    Passing,
    Perform,
    Stands,
    Where,
)
from services.executor.memory import Felt, Holding, SituationRecord

Q = np.linspace(0.0, 1.4, 15)
FELT = Felt(q=Q.tobytes(), measured=Q.tobytes(), head=(0.1, 0.2), time=5.0)
MOVE = rc.MoveJoint("m1", Side.LEFT, ((0.0,) * 8,), 0.3)
KEPT = SituationRecord(q=(1.0,) * 15, time=7.0)
HOLDING = SituationRecord(
    q=(1.0,) * 15,
    held={Side.LEFT: Holding("jar_1", "g", Pose((0, 0, 0), (1, 0, 0, 0)), 0.3)},
    epoch="one",
)
POSTURE = KEPT.posture()
assert POSTURE is not None
DONE = rc.Done("m1", POSTURE, (), {}, 2.0)
MOTION = motion("m1", np.zeros((101, 15)))
OTHER = 99
NO_LOOP = (fact(Kind.ENDED, "loop"),)


def idle(felt: Felt = FELT) -> Driven:
    """ex has found out how its robot stands."""
    one = Driven(behaviours.agent(), wiring("ex", "test"))
    one.step(Started())
    assert one.tells == [Halt(0)]
    one.step(Local(Stands(0, felt)))
    kept = one.state.memory.remembered
    assert (kept.q, kept.head, kept.time) == (tuple(Q), felt.head, felt.time)
    return one


def preparing() -> Driven:
    """An act was taken; its skill computes."""
    one = idle()
    ask(one, MOVE, "t1")
    assert one.tells == [Where(1)]
    one.step(Local(Stands(1, FELT)))
    return one


def acting() -> Driven:
    """Its first motion is under way."""
    one = preparing()
    one.step(Local(Move(1, MOTION, 3.0, KEPT)))
    return one


def stopping() -> Driven:
    """It was cancelled; the motion brakes."""
    one = acting()
    cancel(one, "t1")
    assert one.tells == [Brake(1, "m1")]
    return one


def halting() -> Driven:
    """The loop was lost; the robot is brought to rest."""
    one = acting()
    one.step(Local(Lost(1, NO_LOOP, "no loop")))
    assert one.tells == [Drop(1), Halt(1)]
    return one


STATES = (preparing, acting, stopping, halting)


def ask(one: Driven, command: rc.Command, talk: str) -> None:
    """ta's request."""
    one.hears("ta", "request", P.REQUEST, command, talk=talk)


def cancel(one: Driven, talk: str) -> None:
    """ta's cancel."""
    one.hears("ta", "request", P.CANCEL, talk=talk)


def said(one: Driven) -> list[tuple[P, str, Any]]:
    """Performative, conversation and content of what was said in the last step."""
    read = one.core.wiring.languages.read
    return [
        (sent.performative, sent.conversation, read(sent)[0] if sent.content else None)
        for sent in one.sends()
    ]


def test_acts_are_counted() -> None:
    """Words of one act are not news of the next."""
    one = idle()
    for number in (1, 2):
        ask(one, rc.MoveJoint(f"m{number}", Side.LEFT, ((0.0,) * 8,), 0.3), f"t{number}")
        assert one.tells == [Where(number)]
        cancel(one, f"t{number}")
        assert one.state.memory.number == number
        assert one.state.memory.soft.felt is None


def test_the_skill_gets_the_act_and_how_the_robot_stands() -> None:
    """The skill's memory is the act's from then on; the agreement tells how long."""
    one = preparing()
    assert one.tells == [Perform(1, MOVE, one.state.memory.remembered, FELT)]
    assert one.state.memory.soft.felt == FELT
    one.step(Local(Move(1, MOTION, 3.0, KEPT)))
    assert said(one) == [(P.AGREE, "t1", rc.Accepted("m1", 3.0))]
    assert one.tells == [Do(1, MOTION)]
    assert one.state.memory.remembered == KEPT


OF_ANOTHER_ACT = (
    Stands(OTHER, FELT),
    Move(OTHER, MOTION, 3.0, KEPT),
    Ended(OTHER, KEPT.not_done("m0", "failed", NO_LOOP), KEPT),
    Lost(OTHER, NO_LOOP, "old"),
    Passing(OTHER, FELT),
    GoOn(OTHER, "m1", 0.25),
    Brake(OTHER, "m1"),
)


def test_words_of_another_act_change_nothing() -> None:
    """Words of a killed worker are ignored, in every state."""
    for state, word in itertools.product(STATES, OF_ANOTHER_ACT):
        one = state()
        memory, place = one.state.memory, one.state.state
        one.step(Local(word))
        found = one.state.memory, one.state.state, one.tells, one.sends()
        assert found == (memory, place, [], []), (state, word)


def test_a_second_act_and_a_subscription_are_refused_in_every_state() -> None:
    """The act under way goes on. At rest a subscription is refused, too: no readings are given out
    yet.
    """
    for state in (*STATES, idle):
        one = state()
        place = one.state.state
        if state is not idle:
            ask(one, rc.Look("l1", ((1.0, 0.0, 1.0),)), "t2")
            busy = rc.NotDone("l1", "busy", (fact(Kind.BUSY, "ex"),))
            assert said(one) == [(P.REFUSE, "t2", busy)], state
        one.hears("ta", "subscribe", P.SUBSCRIBE, talk="s1")
        assert [(act, talk) for act, talk, _ in said(one)] == [(P.REFUSE, "s1")], state
        assert one.state.state == place, state


@pytest.mark.parametrize(
    ("event", "why"),
    [
        (Local(Lost(1, NO_LOOP, "no loop")), NO_LOOP),
        (Local(Crashed("OSError: no room")), (fact(Kind.ENDED, "skill_process"),)),
        (Tick(), (fact(Kind.NO_MOTION_FOUND, SKILL_WITHIN_S),)),
    ],
)
def test_an_act_whose_skill_gives_no_motion_is_interrupted(event: Event, why: Facts) -> None:
    """The worker is dropped, ta told why; nothing moved, so it is refused, and ex is at rest."""
    one = preparing()
    one.now += SKILL_WITHIN_S - 0.1
    one.step(Tick())
    assert one.state.state == "preparing"
    one.now += 0.2
    one.step(event)
    ((act, talk, outcome),) = said(one)
    assert (act, talk, outcome.kind) == (P.REFUSE, "t1", "interrupted")
    assert outcome.why == why
    assert one.tells == [Drop(1)]
    assert one.state.state == "idle"
    assert one.state.wakes == {}


def test_a_look_at_a_motion_is_the_skills() -> None:
    """It gets what the loop felt, and its answer is the loop's; nothing is written into ex's memory
    by that.
    """
    answers = (GoOn(1, "m1", 0.25), Brake(1, "m1"))
    for state, answer in itertools.product((acting, stopping), answers):
        one = state()
        memory = one.state.memory
        one.step(Local(Passing(1, FELT)))
        assert one.tells == [Glance(1, FELT)]
        one.step(Local(answer))
        assert one.tells == [answer]
        assert one.state.memory == memory


def ended(phase: str) -> Felt:
    """What the loop felt at the end of a motion."""
    return msgspec.structs.replace(FELT, ended=phase)


def test_a_cancel_after_a_skill_braked_by_itself_is_told_to_it() -> None:
    """The end of the braked motion was no word of a cancel; that of the next one is."""
    one = acting()
    one.step(Local(Brake(1, "m1")))
    one.step(Local(Moved(1, ended("cancelled"))))
    assert one.tells == [Feel(1, ended("cancelled"))]
    one.step(Local(Move(1, MOTION, 3.0, KEPT)))
    cancel(one, "t1")
    assert one.tells == [Brake(1, "m1")]
    one.step(Local(Moved(1, ended("done"))))
    assert one.tells == [Feel(1, ended("cancelled"))]


def test_a_cancel_while_the_skill_computes_is_told_in_place_of_its_next_motion() -> None:
    """With the place in which the motion before has ended. What the skill wants then makes its work
    safe, and is begun.
    """
    one = acting()
    there = msgspec.structs.replace(ended("done"), time=9.0)
    one.step(Local(Moved(1, there)))
    cancel(one, "t1")
    assert one.tells == []
    one.step(Local(Move(1, MOTION, 3.0, KEPT)))
    told = msgspec.structs.replace(there, ended="cancelled", why=(fact(Kind.CANCELLED),))
    assert one.tells == [Feel(1, told)]
    one.step(Local(Move(1, MOTION, 3.0, KEPT)))
    assert one.tells == [Do(1, MOTION)]


def test_a_skill_process_that_ends_in_an_act_ends_the_act() -> None:
    """Interrupted where the robot rests between two motions; where it moves it is brought to rest,
    and the outcome is unknown.
    """
    crash, why = Local(Crashed("OSError: no room")), (fact(Kind.ENDED, "skill_process"),)
    for moves in (False, True):
        one = acting()
        if not moves:
            one.step(Local(Moved(1, ended("done"))))
        one.step(crash)
        assert one.tells == ([Drop(1), Halt(1)] if moves else [Drop(1)])
        if moves:
            one.step(Local(Stands(1, FELT)))
        ((act, _, outcome),) = said(one)
        kind = "unknown" if moves else "interrupted"
        assert (act, outcome.kind, outcome.why) == (P.FAILURE, kind, why)


def test_that_it_sees_by_rays_is_logged_and_changes_nothing() -> None:
    """In every state."""
    for state in (idle, *STATES):
        one = state()
        memory, place = one.state.memory, one.state.state
        one.step(Local(ByRays("no display")))
        found = one.state.memory, one.state.state, one.tells, one.sends()
        assert found == (memory, place, [], []), state
        (line,) = [line for effects in one.out for line in effects.logs]
        assert line.fields["reason"] == "no display"


def test_a_skill_that_ends_without_a_motion_is_the_outcome() -> None:
    """There was nothing to do; what it remembers is kept."""
    one = preparing()
    one.step(Local(Ended(1, DONE, KEPT)))
    assert said(one) == [(P.INFORM, "t1", DONE)]
    memory = one.state.memory
    found = memory.act, memory.last, memory.remembered, memory.soft.felt
    assert found == (None, "m1", KEPT, None)


ELSEWHERE = msgspec.structs.replace(FELT, epoch="another", q=(Q + 1).tobytes())


@pytest.mark.parametrize("lost", [False, True])
def test_in_another_world_everything_is_forgotten_once(lost: bool) -> None:
    """Before an act, or after the loss of the loop: what was held and seen is of a world that is no
    more.
    """
    one = idle(msgspec.structs.replace(FELT, epoch="one"))
    ask(one, MOVE, "t1")
    if lost:
        one.step(Local(Stands(1, msgspec.structs.replace(FELT, epoch="one"))))
        one.step(Local(Move(1, MOTION, 3.0, HOLDING)))
        one.step(Local(Lost(1, NO_LOOP, "no loop")))
    one.step(Local(Stands(1, ELSEWHERE)))
    ((_, _, outcome),) = said(one)[-1:]
    assert (outcome.kind, outcome.body, outcome.held) == ("new-world", None, {})
    assert one.state.memory.remembered == SituationRecord(
        tuple(Q + 1), (0.1, 0.2), time=5.0, epoch="another"
    )
    ask(one, msgspec.structs.replace(MOVE, key="m2"), "t2")
    one.step(Local(Stands(2, ELSEWHERE)))
    assert isinstance(one.tells[-1], Perform)


@pytest.mark.parametrize(("cancelled", "answer"), [(False, P.FAILURE), (True, P.INFORM)])
def test_after_a_loss_the_outcome_is_unknown_once_the_robot_stands(
    cancelled: bool, answer: P
) -> None:
    """It stands where the loop says. After a cancel the outcome comes in reply to that."""
    one = halting()
    assert one.state.wakes == {}
    if cancelled:
        cancel(one, "t1")
        assert (one.state.state, said(one)) == ("stopping", [])
    one.step(Local(Stands(1, FELT)))
    ((act, _, outcome),) = said(one)
    assert (act, outcome.kind, outcome.why) == (answer, "unknown", NO_LOOP)
    assert one.state.memory.remembered.q == tuple(Q)


def test_a_restart_while_it_stops_brings_the_robot_to_rest() -> None:
    """The reason of the unknown outcome is the one known first."""
    for state, why in ((stopping, (fact(Kind.ENDED, "ex"),)), (halting, NO_LOOP)):
        one = state()
        one.step(Started(first=False))
        assert one.tells == [Drop(1), Halt(1)]
        one.step(Local(Stands(1, FELT)))
        assert said(one)[0][2].why == why


def test_a_loop_lost_while_it_stops_is_halted() -> None:
    """Nobody brakes any more."""
    one = stopping()
    one.step(Local(Lost(1, NO_LOOP, "no loop")))
    assert one.tells == [Drop(1), Halt(1)]


def test_a_cancel_of_an_act_that_is_done_is_answered_as_too_late() -> None:
    """The act's inform, and a failure in reply to the cancel."""
    one = stopping()
    one.step(Local(Ended(1, DONE, KEPT)))
    assert [act for act, _, _ in said(one)] == [P.INFORM, P.FAILURE]
    assert not one.state.conversations


def test_a_cancel_of_something_else_does_not_stop_the_act() -> None:
    """It is not the conversation of the act."""
    one = preparing()
    cancel(one, "t9")
    assert one.state.state == "preparing"
