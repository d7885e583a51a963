"""Twenty commands and cancels in ten seconds: every task ends, each is told once, and the next
command is served.
"""

from collections import Counter

from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st
from msgspec.structs import replace
from pretended_fleet import FINAL, Fleet

from agent_runtime.testing.memory_bus import Faults, Point
from services.human_interface.device_messages import CancelWanted, NewEvent, Sentence
from services.human_interface.grammar import understand

COUNT, WITHIN_S = 20, 10.0
WORDS = (
    "pour the jar into the bowl",
    "look around",
    "pour the jar into the bowl and then look around",
    "look around, before anything else",
)
MEANT = {text: understand(text) for text in WORDS}
first, more = st.sampled_from(WORDS), st.sampled_from(("", "later"))
said = st.tuples(st.floats(0.0, WITHIN_S), st.one_of(first, more))
some = settings(  # an example takes seconds: twenty commands would be shrunk for minutes
    deadline=None,
    max_examples=10,
    suppress_health_check=list(HealthCheck),
    phases=(Phase.explicit, Phase.reuse, Phase.generate),
)


def spoken(number, words):
    """The person's words: a wish, one for later, or a cancel of the oldest open task."""
    if not words:
        return CancelWanted(f"t{number}")
    text = WORDS[1] if words == "later" else words
    word = Sentence(f"t{number}", text, MEANT[text])
    return replace(word, urgency=int(word.meaning.when.urgent), later_s=5.0 * (words == "later"))


def told_ends(fleet):
    """How often the person was told the end of each task."""
    events = (one.event for one in fleet.person.told if isinstance(one, NewEvent))
    return Counter(one.task for one in events if one.name in FINAL and one.task)


def all_end(fleet, words):
    """Say them all; every task that hi named ends, and the person hears each end once."""
    fleet.until(lambda: fleet.up("hi") and "co" in fleet.wires.nodes["hi"].state.soft.peers)
    for number, (at, text) in enumerate(words):
        fleet.wires.post("hi", spoken(number, text), at)
    fleet.wires.run_for(WITHIN_S + 1.0)
    fleet.until(lambda: all(task.state in FINAL for task in fleet.tasks), 3000.0)
    fleet.until(fleet.at_rest, 600.0)
    assert all(task.why for task in fleet.tasks if task.state == "failed")
    assert set(told_ends(fleet)) == {task.task for task in fleet.tasks}
    assert set(told_ends(fleet).values()) <= {1}
    assert {one.ticket for one in fleet.answers()} == {f"t{number}" for number in range(len(words))}


@some
@given(st.lists(said, min_size=COUNT, max_size=COUNT))
def test_twenty_commands_in_ten_seconds(words):
    """Commands beyond the limit are refused in words; each step of each agent is a row of the
    design.
    """
    with Fleet() as fleet:
        all_end(fleet, words)
        fleet.say("look around")
        assert fleet.finish(len(fleet.tasks) + 1)[-1] == "done"


@settings(some, max_examples=5)
@given(
    st.lists(said, min_size=COUNT, max_size=COUNT),
    st.sampled_from(("co", "pl", "ta")),
    st.integers(1, 60),
)
def test_no_command_is_lost_where_an_agent_dies_meanwhile(words, victim, steps):
    """Of whichever of the agents that work on it; over wires that lose and double."""
    with Fleet(seed=steps, faults=Faults(loss=0.05, duplication=0.05, delay=0.05)) as fleet:
        fleet.wires.crash(victim, Point.AFTER, in_steps=steps)
        all_end(fleet, words)
