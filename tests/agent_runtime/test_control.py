"""Orders of the operator: what is set counts from the next step on, is journalled, kept, and
replayed.
"""

import dataclasses
from pathlib import Path
from typing import Any

import pytest
from driven import Driven, agree, logged, recording, refused, request
from msgspec import UNSET, Struct
from msgspec.structs import replace
from toy_agents import Want, single, wirings

from agent_runtime.core.agent import Agent
from agent_runtime.core.control import Command, Order, Pause, Resume, SetLevel, SetParameter
from agent_runtime.core.events import Local, Ordered, Started, Tick
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
        if turn.event is None:
            return memory
        return Read((*memory.seen, turn.parameter(name, kind)))

    return with_parameters(single("server", Read(), transition, local=Want), *entries)


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
    """Messages, words of its own side and wake-ups wait, and no time is waited for: else a wake-up
    that is due would be asked for again and again. A resume takes them, each once.
    """
    one = Driven(recording(said=agree), TO_ASKER)
    told(one, Pause())
    for number in (1, 2):
        assert one.step(request(number, conversation=f"c{number}")).receipts == ()
    one.state.wakes["alarm"] = one.now - 1
    one.step(Local(Want(1)))
    effects = one.step(Tick())
    assert (effects.more, effects.wake_at) == (False, None)
    assert one.state.memory.seen == ()
    told(one, Resume(), "2")
    assert one.state.memory.seen == ("Received", "Received", "Local", "Woken")
    assert [receipt.taken for effects in one.out for receipt in effects.receipts] == [1, 2]


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
    """Each has a record; a log line says which it was. The record of an agent that nobody ordered
    is as before, so recordings of older runs replay to the same bytes.
    """
    one = Driven(recording(), TO_ASKER)
    assert one.state.settings is UNSET
    assert b"settings" not in one.core.record(one.state)
    effects = one.step(Ordered(Command("1", Pause())))
    assert effects.record is not None
    assert [(line.event, line.fields["order"]) for line in effects.logs] == [("ordered", "pause")]


# --- parameters -----------------------------------------------------------------------------------


def test_a_step_reads_the_default_and_then_what_was_set() -> None:
    """From the very step on in which it is told of it."""
    one = Driven(reading(SPEED), TO_ASKER)
    one.step(Local(Want(1)))
    assert told(one, SetParameter("speed", 2)) == ""
    one.step(Local(Want(2)))
    assert one.state.memory.seen == (1.0, 2.0, 2.0)
    assert all(type(value) is float for value in one.state.memory.seen)


NUMBER, INTEGER = "it is a number from 0.5 to 4", "it is an integer from 1 to 9"


@pytest.mark.parametrize(
    ("order", "why"),
    [
        (SetParameter("speed", 4.5), f"speed of server cannot be 4.5; {NUMBER}"),
        (SetParameter("speed", "fast"), f"speed of server cannot be 'fast'; {NUMBER}"),
        (SetParameter("speed", float("nan")), f"speed of server cannot be nan; {NUMBER}"),
        (SetParameter("tries", 2.5), f"tries of server cannot be 2.5; {INTEGER}"),
        (SetParameter("tries", True), f"tries of server cannot be True; {INTEGER}"),
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
    for order, id, obeyed, heard in (
        (SetParameter("speed", 2.0), "1", True, 1),
        (SetParameter("speed", 2.0), "1", True, 1),
        (SetLevel("info"), "2", True, 1),
        (SetParameter("speed", 9.0), "3", False, 1),
        (Pause(), "4", True, 1),
        (SetParameter("speed", 3.0), "5", True, 1),
        (Resume(), "6", True, 2),
    ):
        assert (told(one, order, id) == "") is obeyed
        assert one.state.memory.seen == ("Ordered",) * heard


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
    for agent, words in (
        (reading(SPEED, name="sped"), r"parameter 'sped' is not in the design.*there are speed"),
        (reading(SPEED, kind=int), r"parameter 'speed' was read as int.*it is float"),
    ):
        refused(words, agent, TO_ASKER, Local(Want(1)))


def test_orders_replay_to_the_same_bytes(tmp_path: Path) -> None:
    """The log of steps has them like any other event."""
    orders = (SetParameter("speed", 2), Pause(), Resume(), SetParameter("speed", "x"))
    given = [Ordered(Command(str(number), order)) for number, order in enumerate(orders)]
    events = (Local(Want(1)), *given, Local(Want(2)))
    logged(tmp_path / "server.steps", reading(SPEED), (events,))
    found = steplog.again(Core(reading(SPEED), TO_ASKER), tmp_path / "server.steps")
    assert (found.steps, found.parted) == (len(events), None)
