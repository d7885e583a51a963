"""Orders of the operator: what is set counts from the next step on, is journalled, kept, and
replayed.
"""

import dataclasses
from pathlib import Path
from typing import Any

import pytest
from driven import Driven, agree, recording, request
from msgspec import UNSET, Struct
from msgspec.structs import replace
from toy_agents import Want, wirings

from agent_runtime.core.agent import Agent, Behaviour
from agent_runtime.core.control import Command, Order, Pause, Resume, SetLevel, SetParameter
from agent_runtime.core.errors import BehaviourError
from agent_runtime.core.events import Local, Ordered, Started, Tick, Woken
from agent_runtime.core.reception import REFUSED
from agent_runtime.core.state import CoreState
from agent_runtime.core.step import UNFIT, Core
from agent_runtime.core.turn import Turn
from agent_runtime.io import steplog
from topdown.model.elements import Agent as Entry
from topdown.model.elements import Parameter, ParameterType
from topdown.model.parameters import Parameters

_, TO_ASKER = wirings()
SPEED = Parameter("speed", ParameterType.NUMBER, 1.0, "drives so fast", least=0.5, most=4.0)
TRIES = Parameter("tries", ParameterType.INTEGER, 3, "asks so often", least=1, most=9)


class Read(Struct, frozen=True):
    """Values that a behaviour read, one for each step."""

    seen: tuple[Any, ...] = ()


def reading(*entries: Parameter, name: str = "speed", kind: type = float) -> Agent[Any]:
    """An agent with parameters, which reads one at each step."""

    def transition(memory: Read, turn: Turn) -> Read:
        return (
            replace(memory, seen=(*memory.seen, turn.parameter(name, kind)))
            if turn.event
            else memory
        )

    parameters = Parameters(Entry("server", parameter=entries))
    return Agent(
        "server", "idle", Read(), {"idle": Behaviour(transition)}, local=Want, parameters=parameters
    )


def with_parameters(agent: Agent[Any], *entries: Parameter) -> Agent[Any]:
    """The same agent with these parameters."""
    return dataclasses.replace(agent, parameters=Parameters(Entry("server", parameter=entries)))


def told(one: Driven, order: Order, id: str = "1") -> str:
    """Give an order; the reason why it was refused, "" where it was obeyed."""
    one.step(Ordered(Command(id, order)))
    assert one.state.soft.answer.id == id
    return one.state.soft.answer.why


def reborn(one: Driven, agent: Agent[Any]) -> CoreState:
    """The next life, from the journal."""
    return Core(agent, TO_ASKER).boot(one.core.record(one.state))


# --- pause ----------------------------------------------------------------------------------------


def test_a_paused_agent_takes_nothing_and_then_all_in_its_order() -> None:
    """Messages, words of its own side and wake-ups wait; a resume takes them, each once."""
    one = Driven(recording(said=agree), TO_ASKER)
    told(one, Pause())
    assert [one.step(request(number, conversation=f"c{number}")).receipts for number in (1, 2)] == [
        (),
        (),
    ]
    one.state.wakes["alarm"] = one.now - 1
    one.step(Local(Want(1)))
    assert one.step(Tick()).more is False
    assert one.state.memory.seen == ()
    told(one, Resume(), "2")
    assert one.state.memory.seen == ("Received", "Received", "Local", "Woken")
    assert [receipt.taken for effects in one.out for receipt in effects.receipts] == [1, 2]


def test_a_paused_agent_waits_for_no_time_of_its_own() -> None:
    """Else a wake-up that is due would be asked for again and again."""
    one = Driven(recording(), TO_ASKER)
    one.state.wakes["alarm"] = one.now - 1
    told(one, Pause())
    assert one.step(Tick()).wake_at is None
    one.now += 1
    told(one, Resume(), "2")
    assert Woken.__name__ in one.state.memory.seen


def test_a_pause_outlives_a_restart() -> None:
    """Not even Started is taken before the resume."""
    one = Driven(recording(), TO_ASKER)
    told(one, Pause())
    one.state = reborn(one, one.core.agent)
    one.step(Started(first=False))
    assert (one.state.paused, one.state.memory.seen) == (True, ())
    told(one, Resume(), "2")
    assert one.state.memory.seen == ("Started",)


def test_an_order_is_journalled_before_it_counts() -> None:
    """Each has a record; a log line says which it was."""
    one = Driven(recording(), TO_ASKER)
    effects = one.step(Ordered(Command("1", Pause())))
    assert effects.record is not None
    assert [(line.event, line.fields["order"]) for line in effects.logs] == [("ordered", "pause")]


def test_the_record_of_an_agent_that_nobody_ordered_is_as_before() -> None:
    """So recordings of older runs replay to the same bytes."""
    one = Driven(recording(), TO_ASKER)
    assert one.state.settings is UNSET
    assert b"settings" not in one.core.record(one.state)


# --- parameters -----------------------------------------------------------------------------------


def test_a_step_reads_the_default_and_then_what_was_set() -> None:
    """From the very step on in which it is told of it."""
    one = Driven(reading(SPEED), TO_ASKER)
    one.step(Local(Want(1)))
    assert told(one, SetParameter("speed", 2)) == ""
    one.step(Local(Want(2)))
    assert one.state.memory.seen == (1.0, 2.0, 2.0)
    assert all(type(value) is float for value in one.state.memory.seen)


@pytest.mark.parametrize(
    ("order", "why"),
    [
        (SetParameter("speed", 4.5), "speed of server cannot be 4.5; it is a number from 0.5 to 4"),
        (
            SetParameter("speed", "fast"),
            "speed of server cannot be 'fast'; it is a number from 0.5 to 4",
        ),
        (
            SetParameter("speed", float("nan")),
            "speed of server cannot be nan; it is a number from 0.5 to 4",
        ),
        (SetParameter("tries", 2.5), "tries of server cannot be 2.5; it is an integer from 1 to 9"),
        (
            SetParameter("tries", True),
            "tries of server cannot be True; it is an integer from 1 to 9",
        ),
        (
            SetParameter("sped", 2.0),
            "agent server has no parameter 'sped'; its parameters: speed, tries",
        ),
        (SetLevel("loud"), "log level 'loud' is none of debug, info, warning, error"),
    ],
)
def test_an_order_that_does_not_fit_is_refused_in_words(order: Order, why: str) -> None:
    """Nothing is changed by it, and it is counted; the bounds themselves are allowed."""
    one = Driven(reading(SPEED, TRIES), TO_ASKER)
    assert told(one, order) == why
    assert one.state.settings is UNSET
    assert one.state.counts == {REFUSED: 1}
    assert [told(one, SetParameter("speed", value), "2") for value in (0.5, 4.0)] == ["", ""]


def test_a_behaviour_is_told_once_of_a_value_and_of_no_other_order() -> None:
    """Not of a copy, though the agent obeys that again; not of what was refused. While paused it
    waits.
    """
    one = Driven(with_parameters(recording(), SPEED), TO_ASKER)
    for order, id in (
        (SetParameter("speed", 2.0), "1"),
        (SetParameter("speed", 2.0), "1"),
        (SetLevel("info"), "2"),
    ):
        assert told(one, order, id) == ""
    told(one, SetParameter("speed", 9.0), "3")
    assert one.state.memory.seen == ("Ordered",)
    for order, id in ((Pause(), "4"), (SetParameter("speed", 3.0), "5")):
        told(one, order, id)
    assert one.state.memory.seen == ("Ordered",)
    told(one, Resume(), "6")
    assert one.state.memory.seen == ("Ordered", "Ordered")


def test_a_value_outlives_a_restart_and_a_change_of_the_design_where_it_still_fits() -> None:
    """If it does not fit, the default counts again, and that is counted."""
    one = Driven(reading(SPEED, TRIES), TO_ASKER)
    told(one, SetParameter("speed", 2.0))
    told(one, SetParameter("tries", 9), "2")
    assert reborn(one, one.core.agent).soft.parameters == {"speed": 2.0, "tries": 9}
    narrowed = reborn(one, reading(replace(SPEED, most=1.5), TRIES))
    assert narrowed.soft.parameters == {"speed": 1.0, "tries": 9}
    assert narrowed.counts == {UNFIT: 1}


def test_a_behaviour_that_reads_what_is_not_there_is_told_what_is() -> None:
    """Or what it is, where it reads it as another type."""
    with pytest.raises(
        BehaviourError, match=r"parameter 'sped' is not in the design.*there are speed"
    ):
        Driven(reading(SPEED, name="sped"), TO_ASKER).step(Local(Want(1)))
    with pytest.raises(BehaviourError, match=r"parameter 'speed' was read as int.*it is float"):
        Driven(reading(SPEED, kind=int), TO_ASKER).step(Local(Want(1)))


def test_orders_replay_to_the_same_bytes(tmp_path: Path) -> None:
    """The log of steps has them like any other event."""
    agent, log = reading(SPEED), steplog.StepLog(tmp_path / "server.steps")
    core = Core(agent, TO_ASKER)
    state = core.boot(None)
    log.boot(state.incarnation, b"", 0.0)
    orders = (SetParameter("speed", 2), Pause(), Resume(), SetParameter("speed", "x"))
    events = [
        Local(Want(1)),
        *(Ordered(Command(str(n), order)) for n, order in enumerate(orders)),
        Local(Want(2)),
    ]
    for event in events:
        state, effects = core.step(state, event, 1.0)
        log.write([steplog.noted(state.incarnation, state.soft.step, 1.0, event, effects)])
    log.close()
    again = list(steplog.replay(Core(agent, TO_ASKER), steplog.read(tmp_path / "server.steps")))
    assert len(again) == len(events)
    assert all(steplog.fingerprint(effects) == step.output for step, effects in again)
