"""Moments of faults: what may be written for one, and when it is there."""

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from agent_runtime.io.tap import Sample
from companion.design import DESIGN
from operate.cli.errors import UsageError
from operate.cli.faults.moments import After, InRun, InState, Message, counter, parse, words
from operate.run_folder import Happened, PlanAt

STATES = [(agent, one.name) for agent, entry in DESIGN.agents.items() for one in entry.state]
OWNERS = {state: [agent for agent, name in STATES if name == state] for _, state in STATES}


@given(st.floats(0, 1e6).map(lambda value: round(value, 3)), st.sampled_from(["", "s"]))
def test_seconds(value: float, unit: str) -> None:
    """A number is that many seconds."""
    assert parse(f"{value:.3f}{unit}", DESIGN, "pl") == After(value)


@given(st.integers(1, 10**6), st.sampled_from(["st", "nd", "rd", "th", ""]), st.sampled_from(["pl", "router"]))
def test_messages(count: int, ending: str, target: str) -> None:
    """Of an agent its own are counted, of another process all."""
    assert parse(f"{count}{ending}-message", DESIGN, target) == Message(count, "pl" if target == "pl" else "")


@given(st.sampled_from(STATES), st.sampled_from([*DESIGN.agents, "router"]))
def test_states(named: tuple[str, str], target: str) -> None:
    """AGENT:STATE is that one's; a state alone is the target's, else the only one's, else it is asked whose."""
    agent, state = named
    assert parse(f"{agent}:{state}", DESIGN, target) == InState(agent, state)
    owners = OWNERS[state]
    if target in owners or len(owners) == 1:
        assert parse(state, DESIGN, target) == InState(target if target in owners else owners[0], state)
    else:
        with pytest.raises(UsageError, match=f"{owners[0]}:{state}"):
            parse(state, DESIGN, target)


@given(st.text(min_size=1, max_size=12), st.text(min_size=1, max_size=12))
def test_events_and_states_of_a_plan(name: str, other: str) -> None:
    """A whole name of an event, and a whole part of a path; neither is there where only a text says so."""
    event, state = parse(f"event:{name}", DESIGN, "pl"), parse(f"plan:{name}", DESIGN, "pl")
    assert (event, state) == (InRun(event=name), InRun(plan=name))
    assert words(event) == words(state) == repr(name)
    assert event.there(Happened(t=0.0, name=name, text=other))
    assert state.there(PlanAt(t=0.0, at=name))
    assert state.there(PlanAt(t=0.0, at=f"{name}/{other}"))
    for line in (Happened(t=0.0, name=f"{name}{other}", text=name), PlanAt(t=0.0, at=name)):
        assert not event.there(line)
    for line in (Happened(t=0.0, name=name), PlanAt(t=0.0, at=f"{other}/{name}")):
        assert not state.there(line) or f"{other}/{name}".startswith(f"{name}/")


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
    st.lists(st.sampled_from([("pl", "km"), ("km", "pl"), ("ta", "ex"), ("_", "x")]), max_size=30), st.integers(1, 12)
)
def test_the_nth_message_is_counted(pairs: list[tuple[str, str]], count: int) -> None:
    """Communicates of others and other samples do not count."""
    there = counter(Message(count, "pl"))
    samples = [Sample("roco/s/_/ping/pl/km", b"", 1.0) if a == "_" else spoken(a, b) for a, b in pairs]
    when = next((n for n, sample in enumerate(samples) if there(sample)), None)
    own = [n for n, pair in enumerate(pairs) if "pl" in pair]
    assert when == (own[count - 1] if len(own) >= count else None)


def test_a_state_is_there_when_it_is_told() -> None:
    """By that agent, in that state."""

    def beat(agent: str, state: str) -> Sample:
        return Sample(f"roco/s/_/state/{agent}", msgspec.json.encode({"agent": agent, "state": state}), 1.0)

    there = counter(InState("pl", "idle"))
    assert [there(one) for one in (beat("pl", "busy"), beat("km", "idle"), spoken("pl", "km"))] == [False] * 3
    assert not there(Sample("roco/s/_/state/pl", b"\xff", 1.0))
    assert there(beat("pl", "idle"))
