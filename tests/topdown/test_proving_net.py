"""Nets: what their commands do, and that names they do not have are found."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from topdown.prove.engine import DEADLOCK, WRONG, explore
from topdown.prove.net import (
    Command,
    Copy,
    Empty,
    Head,
    Is,
    Net,
    NetError,
    NetModel,
    Queue,
    Send,
    Set,
    Take,
    Variable,
    Wrong,
    is_,
)

VARIABLES = (Variable("a", ("x", "y", "z"), "A"), Variable("b", ("x", "y", "z"), "B", "y"))
QUEUES = (Queue("q", ("m", "n"), 2, "B"),)
values = st.sampled_from(["x", "y", "z"])
guards = st.one_of(
    st.builds(Is, st.sampled_from(["a", "b"]), st.frozensets(values, min_size=1)),
    st.just(Head("q", frozenset({"m"}))),
    st.just(Head("q", frozenset({"m", "n"}))),
    st.just(Empty("q")),
)
effects = st.one_of(
    st.builds(Set, st.sampled_from(["a", "b"]), values),
    st.just(Copy("a", "b")),
    st.just(Copy("b", "a")),
    st.builds(Send, st.just("q"), st.sampled_from(["m", "n"])),
)


def holds(guard, state):
    """Whether a guard holds in {name: value or list of words}, read off its own words."""
    match guard:
        case Is(name, wanted):
            return state[name] in wanted
        case Head(name, words):
            return bool(state[name]) and state[name][0] in words
        case Empty(name):
            return not state[name]


def changed(effects, state):
    """The state after the effects; None where there is no room."""
    state = {
        name: list(value) if isinstance(value, list) else value for name, value in state.items()
    }
    for effect in effects:
        match effect:
            case Set(name, value):
                state[name] = value
            case Copy(name, source):
                state[name] = state[source]
            case Send(name, word):
                state[name].append(word)
            case Take(name):
                state[name].pop(0)
    return state if len(state["q"]) <= 2 else None


commands = st.builds(
    lambda guards, effects: Command("A", "acts", tuple(guards), tuple(effects)),
    st.lists(guards, max_size=3),
    st.lists(effects, max_size=3),
)
takes = st.builds(
    lambda to: Command("B", "takes", (Head("q", frozenset({"m"})),), (Take("q"), Set("b", to))),
    values,
)


@given(st.lists(commands | takes, max_size=6))
def test_commands_do_what_their_words_say(table):
    """Against a reading of the words one by one, in every state that is reached."""
    net = Net("any", VARIABLES, QUEUES, tuple(table), ((),), lifelines=("A", "B"))
    model = NetModel(net)

    def named(state):
        a, b, q = state
        return {"a": "xyz"[a], "b": "xyz"[b], "q": ["mn"[word] for word in q]}

    for state in explore(model, first=False, keep=True).reached:
        expected = {
            repr(after)
            for command in table
            if all(holds(guard, named(state)) for guard in command.guards)
            and (after := changed(command.effects, named(state)))
        }
        assert {repr(named(move[2])) for move in model.moves(state)} == expected


def net_of(*commands, rest=((),), wrong=()):
    """A net of the variables and the queue above."""
    return Net("small", VARIABLES, QUEUES, commands, rest, wrong, ("A", "B"))


def test_a_full_queue_holds_the_sender_back_and_what_is_wrong_ends_the_search():
    """Three sends into two places: no room for the third."""
    send = Command("A", "send -> B", (), (Send("q", "m"),))
    (finding,) = explore(NetModel(net_of(send, rest=((Empty("q"), is_("b", "z")),)))).findings
    assert (finding.kind, len(finding.trace)) == (DEADLOCK, 2)
    assert finding.trace[-1].after == {"A": "x", "B": "y [m, m]"}
    (finding,) = explore(
        NetModel(net_of(send, wrong=(Wrong("waits", (Head("q", frozenset({"m"})),)),)))
    ).findings
    assert (finding.kind, finding.text) == (WRONG, "waits")


@pytest.mark.parametrize(("faults", "states"), [(0, 1), (1, 2), (2, 3), (None, 3)])
def test_faults_are_counted_or_unlimited(faults, states):
    """The words lost: as many as allowed."""
    lose = [
        Command("net", "loses", (is_("a", value),), (Set("a", after),), True, True)
        for value, after in ("xy", "yz")
    ]
    assert (
        explore(NetModel(net_of(*lose, rest=((is_("b", "y"),),)).counted(faults))).states == states
    )


def test_what_a_net_does_not_have_is_named():
    """With the place and what there is."""
    for part, words in (
        (is_("c", "x"), "'c' is no variable; there are a, b"),
        (is_("a", "w"), "w is not in 'a'"),
        (is_("q", "x"), "'q' is no variable"),
        (Head("q", frozenset({"k"})), "k is not in 'q'"),
        (Copy("a", "q"), "'q' is no variable with the domain of 'a'"),
    ):
        with pytest.raises(NetError, match=r"small, A: acts: .*") as error:
            NetModel(net_of(Command("A", "acts", (part,), ())))
        assert words in str(error.value)
