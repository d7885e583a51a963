"""A second opinion: spin stores as many states as are explored here, and finds the same deadlocks
and wrong states.
"""

import re
import shutil
import subprocess

import pytest

from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative as P
from fipa_codec.protocols import QUERY, REQUEST, SUBSCRIBE, State
from fipa_codec.tables import RECEIVE, Role, Row
from topdown.prove import net
from topdown.prove.durable import durable_pair
from topdown.prove.engine import DEADLOCK, WRONG, explore
from topdown.prove.net import NetModel, is_, promela
from topdown.prove.roles import restricted
from topdown.prove.volatile import Rules, volatile_pair

ASKER, SERVER = Role.INITIATOR, Role.PARTICIPANT
SMALL = restricted(REQUEST, {ASKER: {"request", "cancel"}, SERVER: {"agree", "inform", "refuse"}})
REFERRED = restricted(QUERY, {ASKER: {"query-ref"}, SERVER: {"inform", "refuse"}})
NOT_ASKED_AGAIN, IN_RAM = Rules(asks_again=False), Rules(keeps_due=False)
WATCH = restricted(SUBSCRIBE, {ASKER: {"subscribe"}, SERVER: {"agree", "inform"}})


def spoilt(server):
    """The small request with another table of the server's."""
    return durable_pair(SMALL.with_tables(participant=server), faults=0)


def spoilt_by_a_missing_row():
    """The cancel that crosses the inform has no row."""
    return spoilt(SMALL.tables[SERVER].without(State.DONE, RECEIVE, P.CANCEL))


def spoilt_by_silence():
    """The cancel that came too late is absorbed."""
    server = SMALL.tables[SERVER]
    for state in (State.START, State.DONE, State.REFUSED):
        server = server.with_rows(Row(state, RECEIVE, P.CANCEL, Kind.PLAIN, State.DONE))
    return spoilt(server)


def with_queues(room):
    """Everything that a net may say: two who talk over queues, and never is B served twice."""
    idle, busy, off, empty = is_("a", "idle"), is_("a", "busy"), is_("b", "off"), net.Empty("to b")
    ask, stop = net.Send("to b", "ask"), net.Send("to b", "stop")
    asked = net.Head("to b", frozenset({"ask"}))
    stopped = net.Head("to b", frozenset({"stop", "halt"}))
    serve = (net.Take("to b"), net.Copy("last", "b"), net.Set("b", "on"))
    commands = (
        net.Command("A", "asks", (idle, empty), (ask, net.Set("a", "busy"))),
        net.Command("A", "asks again", (busy,), (ask,)),
        net.Command("A", "cancels", (busy,), (stop,)),
        net.Command("B", "serves", (asked,), serve),
        net.Command("B", "stops", (stopped,), (net.Take("to b"), net.Set("b", "off"))),
        net.Command("A", "rests", (busy, off, empty), (net.Set("a", "idle"),)),
    )
    states = (("a", ("idle", "busy")), ("b", ("off", "on")), ("last", ("off", "on")))
    variables = tuple(net.Variable(*one) for one in states)
    queues = (net.Queue("to b", ("ask", "stop", "halt"), room),)
    never = (net.Wrong("twice", (is_("last", "on"), idle)),)
    return net.Net("queues", variables, queues, commands, ((idle, empty),), never)


MODELS = {
    "query": lambda: durable_pair(REFERRED, faults=1),
    "request": lambda: durable_pair(SMALL, faults=0),
    "request, a fault": lambda: durable_pair(SMALL, faults=1),
    "question": lambda: volatile_pair(QUERY, faults=1),
    "observations": lambda: volatile_pair(WATCH, faults=2, latest=True),
    "queues": lambda: with_queues(2),
    "long queues": lambda: with_queues(4),
    "spoilt: a row is missing": spoilt_by_a_missing_row,
    "spoilt: silence": spoilt_by_silence,
    "spoilt: not asked again": lambda: volatile_pair(QUERY, faults=1, rules=NOT_ASKED_AGAIN),
    "spoilt: due in RAM": lambda: volatile_pair(WATCH, faults=1, latest=True, rules=IN_RAM),
}


def verified(text, folder):
    """(states stored, whether anything is wrong, whether there is a deadlock) in spin's words."""

    def run(*words):
        result = subprocess.run(words, cwd=folder, capture_output=True, text=True, check=False)
        assert result.returncode == 0, result.stdout + result.stderr
        return result.stdout

    (folder / "net.pml").write_text(text)
    run("spin", "-a", "-o1", "-o2", "net.pml")
    run("gcc", "-O0", "-w", "-DSAFETY", "-DNOREDUCE", "-o", "pan", "pan.c")
    said = run("./pan", "-m1000000", "-c0", "-n")
    stored = re.search(r"(\d+) states, stored", said)
    assert stored is not None, said
    assert "max search depth too small" not in said
    return (
        int(stored[1]),
        bool(re.search(r"pan:\d+: assertion violated", said)),
        bool(re.search(r"pan:\d+: invalid end state", said)),
    )


@pytest.mark.long
@pytest.mark.skipif(
    not (shutil.which("spin") and shutil.which("gcc")),
    reason="needs spin and gcc (Debian: apt install spin gcc libc6-dev)",
)
@pytest.mark.parametrize("name", MODELS)
def test_spin_agrees(name, tmp_path):
    """States and verdict; in nets with faults a deadlock is an assertion as well."""
    made = MODELS[name]()
    stored, violated, ended = verified(promela(made), tmp_path)
    found = explore(NetModel(made), first=False)
    kinds = {finding.kind for finding in found.findings}
    assert stored == found.states
    if any(command.fault for command in made.commands):
        assert violated == bool(kinds & {WRONG, DEADLOCK})
        assert not ended
    else:
        assert violated == (WRONG in kinds)
        assert ended == (DEADLOCK in kinds)
    assert name.startswith("spoilt") == bool(kinds & {WRONG, DEADLOCK}) or "queue" in name


def test_the_text_says_what_its_numbers_mean():
    """Names, values and the words of each command."""
    text = promela(MODELS["request"]())
    assert "0 start" in text
    assert "participant: agree -> initiator" in text
    assert text.count("d_step") > len(MODELS["request"]().commands)
