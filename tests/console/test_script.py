"""A real agent's words held against a recording: what is a line, what a cue, and where words first
differ.
"""

from itertools import product
from typing import Any

import msgspec
from calling import POUR
from hypothesis import given
from hypothesis import strategies as st

from console.traffic.listen import heard_message, recorded
from console.traffic.replace import Difference, Part, Script, before, difference, parts, plain
from fipa_codec.communicate import Communicate
from fipa_codec.performatives import Performative

AGENTS = ("co", "pl", "km", "ta", "ex", "hi")
HEARD = [
    (one.at, communicate)
    for sample in recorded(POUR)
    if sample is not None
    and (one := heard_message(sample)) is not None
    and (communicate := one.communicate()) is not None
]


def renamed(one: Communicate, prefix: str = "new-") -> Communicate:
    """As another life of the agent would name it."""
    label = prefix + one.reply_with if one.reply_with else ""
    return msgspec.structs.replace(one, id=prefix + one.id, reply_with=label)


def spoken(
    part: tuple[Part, ...], changed: dict[int, Communicate] | None = None, *, shifted: bool = False
) -> tuple[Script, Difference | None]:
    """An agent that says all its lines under other names (its own conversations, too), some of them
    changed.

    `shifted`: each conversation has the name that the recording gives to the next one.
    """
    script = Script(part)
    labels: dict[tuple[str, str], str] = {}
    own = [one.communicate.conversation for one in _first(part) if one.mine]
    new = [*own[1:], "new"][: len(own)] if shifted else [f"new-{name}" for name in own]
    names = dict(zip(own, new, strict=True))
    while (line := script.awaited()) is not None or (cue := script.cue()) is not None:
        if line is None:
            assert cue is not None
            one, was = renamed(script.adapted(cue), "cue-"), cue.communicate
            assert one.conversation == names.get(was.conversation, was.conversation)
            assert one.in_reply_to.startswith("new-") == bool(was.in_reply_to)
            labels[was.sender, was.reply_with] = one.reply_with
            script.given(cue, one)
            continue
        was = (changed or {}).get(line.n, line.communicate)
        talk = was.conversation
        talk = names.setdefault(talk, f"new-{talk}" if talk in own else talk)
        answers = labels.get((was.receiver, was.in_reply_to), was.in_reply_to)
        now = msgspec.structs.replace(renamed(was), conversation=talk, in_reply_to=answers)
        if (found := script.hear(now)) is not None:
            return script, found
    return script, None


def _first(part: tuple[Part, ...]) -> list[Part]:
    first: dict[str, Part] = {}
    for one in part:
        first.setdefault(one.communicate.conversation, one)
    return list(first.values())


def test_the_same_words_under_other_names_are_the_same() -> None:
    """Ids, labels and conversations are the agent's own; a cue that answers has the real ones."""
    for agent, shifted in product(AGENTS, (False, True)):
        part = parts(agent, HEARD)
        script, found = spoken(part, shifted=shifted)
        assert found is None, agent
        assert len(script.spoken) == sum(one.mine for one in part), agent


def test_copies_are_no_lines() -> None:
    """A question asked again is one line."""
    part = parts("pl", HEARD)
    assert len([one for one in part if one.mine and one.communicate.receiver == "km"]) == 116
    assert len([one for _, one in HEARD if one.sender == "pl" and one.receiver == "km"]) == 120


def test_a_recording_that_began_later_is_told() -> None:
    """A whole run has the whole life of each agent; without its first second nobody's is."""
    for agent in AGENTS:
        part = parts(agent, HEARD)
        assert before(part) is None, agent
        later = [one for one in HEARD if one[0] > part[0].at]
        assert before(parts(agent, later)) is not None, agent


def changes(one: Communicate) -> dict[str, Communicate]:
    """Other words in its place, by what differs."""
    failed = one.performative is Performative.FAILURE
    others = {
        "performative": Performative.INFORM if failed else Performative.FAILURE,
        "content": msgspec.Raw(msgspec.msgpack.encode({"type": "Other"})),
        "reply_by": None if one.reply_by else 1.0,
        "language": "XX",
        "in_reply_to": "another",
    }
    return {name: msgspec.structs.replace(one, **{name: other}) for name, other in others.items()}


def test_the_first_difference_is_found_and_named() -> None:
    """The first difference is found in its line, whatever the field, and none before it."""
    part = parts("ta", HEARD)
    mine = [one for one in part if one.mine]
    for line in (mine[0], mine[40], mine[-1]):
        for field, other in changes(line.communicate).items():
            _, found = spoken(part, {line.n: other})
            assert found is not None, field
            assert (found.line, found.field.split(".")[0]) == (line.n, field)


def test_words_beyond_the_recording_are_a_difference() -> None:
    """A conversation that nobody recorded."""
    part = parts("ta", HEARD)
    script, found = spoken(part)
    assert found is None
    more = next(one.communicate for one in part if one.mine)
    assert script.hear(msgspec.structs.replace(more, conversation="one-more")) == Difference(
        0, "words", None, plain(more)
    )


VALUES: st.SearchStrategy[Any] = st.recursive(
    st.none() | st.booleans() | st.integers() | st.text(max_size=3),
    lambda inner: (
        st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=2), inner, max_size=3)
    ),
    max_leaves=12,
)


@given(VALUES, VALUES)
def test_a_difference_is_where_two_values_differ(one: Any, other: Any) -> None:
    """None exactly where they are the same, type by type."""
    assert difference(one, one) is None
    assert (difference(one, other) is None) == (
        msgspec.json.encode(one) == msgspec.json.encode(other) or _same(one, other)
    )


def _same(one: Any, other: Any) -> bool:
    """Equal, with the same types all the way down; the order of keys says nothing."""
    if type(one) is not type(other):
        return False
    if isinstance(one, dict):
        return one.keys() == other.keys() and all(_same(one[key], other[key]) for key in one)
    if isinstance(one, list):
        return len(one) == len(other) and all(map(_same, one, other))
    return bool(one == other)
