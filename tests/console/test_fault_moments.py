"""Moments of faults: what may be written for one, and when it is there."""

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from agent_runtime.io.tap import Sample
from companion.design import DESIGN
from console.errors import UsageError
from console.faults.moments import (
    After,
    Event,
    InPlan,
    InState,
    Message,
    counter,
    moment_text,
    parse,
)
from operate.live_lines import Happened, PlanAt, Step

STATES = [(agent, one.name) for agent, entry in DESIGN.agents.items() for one in entry.state]
OWNERS = {state: [agent for agent, name in STATES if name == state] for _, state in STATES}


@given(st.floats(0, 1e6).map(lambda value: round(value, 3)), st.sampled_from(["", "s"]))
def test_seconds(value: float, unit: str) -> None:
    """A number is that many seconds."""
    assert parse(f"{value:.3f}{unit}", DESIGN, "pl") == After(value)


@given(
    st.integers(1, 10**6),
    st.sampled_from(["st", "nd", "rd", "th", ""]),
    st.sampled_from(["pl", "router"]),
)
def test_messages(count: int, ending: str, target: str) -> None:
    """Of an agent its own are counted, of another process all."""
    assert parse(f"{count}{ending}-message", DESIGN, target) == Message(
        count, "pl" if target == "pl" else ""
    )


@given(st.sampled_from(STATES), st.sampled_from([*DESIGN.agents, "router"]))
def test_states(named: tuple[str, str], target: str) -> None:
    """AGENT:STATE is that one's; a state alone is the target's, else the only one's, else it is
    asked whose.
    """
    agent, state = named
    assert parse(f"{agent}:{state}", DESIGN, target) == InState(agent, state)
    owners = OWNERS[state]
    if target in owners or len(owners) == 1:
        assert parse(state, DESIGN, target) == InState(
            target if target in owners else owners[0], state
        )
    else:
        with pytest.raises(UsageError, match=f"{owners[0]}:{state}"):
            parse(state, DESIGN, target)


names = st.from_regex(r"\A[a-z][a-z-]{0,7}\Z")
ids = st.lists(st.from_regex(r"\A[a-z]{1,5}_[1-9]\Z"), max_size=3, unique=True).map(tuple)


@given(names, ids, names, ids)
def test_an_event_is_there_by_its_name_and_what_it_is_of(
    name: str, of: tuple[str, ...], other: str, more: tuple[str, ...]
) -> None:
    """The first of them are enough; no text makes an event."""
    asked = " ".join((name, *of))
    event = parse(f"event:{asked}", DESIGN, "pl")
    assert event == Event(name, of)
    assert moment_text(event) == repr(asked)
    assert event.there(Happened(t=0.0, name=name, of=(*of, *more), text=other))
    assert event.there(Happened(t=0.0, name=other, of=of)) == (name == other)
    assert not event.there(Happened(t=0.0, name=f"{name}x", of=of, text=asked))
    assert not of or not event.there(Happened(t=0.0, name=name, of=("x_0", *of[1:])))
    assert not event.there(PlanAt(t=0.0, at=Step((name,), name, of)))


@given(
    names, ids, st.sampled_from(["", "Grasp", "Pour"]), names, st.sampled_from(["Grasp", "Pour"])
)
def test_a_step_of_a_plan_is_there_by_what_it_does(
    does: str, things: tuple[str, ...], act: str, other: str, acts: str
) -> None:
    """With its things, and in one of its acts; names of states do not count."""
    asked = " ".join((does, *things)) + (f"/{act}" if act else "")
    moment = parse(f"plan:{asked}", DESIGN, "pl")
    assert moment == InPlan(does, things, act)
    assert moment_text(moment) == repr(asked)
    at = Step((other, "1"), does, (*things, "lid_9"), "left", acts)
    assert moment.there(PlanAt(t=0.0, at=at)) == (act in ("", acts))
    assert not moment.there(PlanAt(t=0.0, at=at, outcome="failed"))
    assert not moment.there(PlanAt(t=0.0, at=Step((does,), f"{does}x", things, act=act)))
    assert not moment.there(PlanAt(t=0.0))
    assert not moment.there(Happened(t=0.0, name=does, of=things))


@given(st.text(max_size=12))
def test_anything_else_is_refused_in_words(text: str) -> None:
    """Never a traceback."""
    try:
        parse(text, DESIGN, "pl")
    except UsageError as error:
        assert text in str(error) or repr(text) in str(error)  # noqa: PT017


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("pl:flying", "pl has no state 'flying'; it has "),
        ("xx:idle", "no agent 'xx'; it has "),
        ("0th-message", "counted from 1"),
        ("event:", "names nothing; give seconds"),
        ("plan:/Grasp", "names no step; give seconds"),
        ("soon", "seconds \\(2.5\\), a time"),
    ],
)
def test_what_there_is_is_said(text: str, words: str) -> None:
    """Names of the design, or the forms."""
    with pytest.raises(UsageError, match=words):
        parse(text, DESIGN, "pl")


def spoken(sender: str, receiver: str) -> Sample:
    """A communicate as it goes by."""
    return Sample(f"roco/s/C4/{sender}/{receiver}/query/query-ref", b"", 1.0)


@given(
    st.lists(st.sampled_from([("pl", "km"), ("km", "pl"), ("ta", "ex"), ("_", "x")]), max_size=30),
    st.integers(1, 12),
)
def test_the_nth_message_is_counted(pairs: list[tuple[str, str]], count: int) -> None:
    """Communicates of others and other samples do not count."""
    there = counter(Message(count, "pl"))
    samples = [
        Sample("roco/s/_/ping/pl/km", b"", 1.0) if a == "_" else spoken(a, b) for a, b in pairs
    ]
    when = next((n for n, sample in enumerate(samples) if there(sample)), None)
    own = [n for n, pair in enumerate(pairs) if "pl" in pair]
    assert when == (own[count - 1] if len(own) >= count else None)


def test_a_state_is_there_when_it_is_told() -> None:
    """By that agent, in that state."""

    def beat(agent: str, state: str) -> Sample:
        told = msgspec.json.encode({"agent": agent, "state": state})
        return Sample(f"roco/s/_/state/{agent}", told, 1.0)

    there = counter(InState("pl", "idle"))
    for other in (beat("pl", "busy"), beat("km", "idle"), spoken("pl", "km")):
        assert not there(other)
    assert not there(Sample("roco/s/_/state/pl", b"\xff", 1.0))
    assert there(beat("pl", "idle"))
