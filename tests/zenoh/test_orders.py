"""Orders of the operator to agents that run: paused, resumed, their log level and parameters set,
over keys and rights.

The depot, brought up as anybody does; a robot is paused, a parameter of the dispatcher decides when
it gives up.
"""

import json
import signal
from collections.abc import Iterator

import msgspec
import pytest
from depot_fleet import Depot, running

from agent_runtime.core.control import Command, Pause
from console.traffic.listen import recorded

pytestmark = [pytest.mark.zenoh, pytest.mark.timeout(120)]


@pytest.fixture(scope="module")
def depot(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Depot]:
    """Running, with orders that come again and again."""
    with running(tmp_path_factory.mktemp("orders"), count=60) as made:
        yield made


def state(depot: Depot, name: str) -> str:
    """The state that `roco agents` tells of an agent."""
    return next(str(row["state"]) for row in depot.json("agents")["agents"] if row["name"] == name)


def test_a_paused_agent_beats_takes_no_step_and_is_told_as_paused(depot: Depot) -> None:
    """Nothing restarts it, and what waits is taken once it is resumed."""
    depot.roco("agent pause mule")
    before = depot.beat("mule")
    assert state(depot, "mule") == "paused"
    assert depot.json("status")["paused"] == ["mule"]
    depot.beats_on("mule")
    now = depot.beat("mule")
    assert (now.pid, now.state, now.paused) == (before.pid, before.state, True)
    assert depot.json("agent start mule")["paused"] is False
    depot.wait(lambda: depot.beat("mule").state != now.state, "it goes on")
    assert state(depot, "mule") != "paused"


def test_a_pause_is_kept_over_a_kill(depot: Depot) -> None:
    """The next life is paused as the last one was."""
    depot.roco("agent pause traffic")
    life = depot.beat("traffic").incarnation
    depot.kill("traffic")
    depot.wait(lambda: depot.beat("traffic").incarnation == life + 1, "it is back")
    assert depot.beat("traffic").paused
    depot.roco("agent start traffic")


def test_the_log_level_is_changed_while_it_runs(depot: Depot) -> None:
    """The agent's output has no more of what it does, though it goes on; its log file has all of
    it.
    """
    out, file = depot.run / "ox.log", depot.run / "logs" / "ox.jsonl"
    assert depot.json("param ox log-level error")["value"] == "error"
    silent, written = out.stat().st_size, file.stat().st_size
    depot.wait(lambda: file.stat().st_size > written + 2000, "it goes on")
    assert out.stat().st_size == silent
    assert depot.json("param ox log-level debug")["value"] == "debug"
    depot.wait(lambda: out.stat().st_size > silent, "it is told again")


def test_a_parameter_decides_from_the_next_step_on(depot: Depot) -> None:
    """With both robots paused an order fails after as many calls as the parameter says; a restart
    keeps it.
    """
    assert depot.json("param dispatcher rounds")["value"] == 20
    for robot in ("mule", "ox"):
        depot.roco("agent pause", robot)
    assert depot.json("param dispatcher rounds 1")["value"] == 1
    file = depot.run / "verdicts.jsonl"
    depot.wait(lambda: "no robot was free in 1 calls" in file.read_text(), "the order is given up")
    assert depot.json("agent restart dispatcher")["process"] == "ready"
    (rounds,) = depot.json("param dispatcher")["parameters"]
    allowed = "an integer from 1 to 1000"
    assert (rounds["value"], rounds["default"], rounds["allowed"]) == (1, 20, allowed)
    for robot in ("mule", "ox"):
        depot.roco("agent start", robot)


def test_what_cannot_be_is_wrong_use(depot: Depot) -> None:
    """Told in words, and nothing is sent."""
    for words, said in {
        "param dispatcher rounds 0": "rounds of dispatcher cannot be '0'; it is an integer from 1",
        "param dispatcher round 5": "dispatcher has no parameter 'round'; its parameters: rounds",
        "param ox rounds": "agent ox has no parameter 'rounds'; its parameters: none",
        "agent pause router": "'router' is not an agent of depot; its agents: desk, dispatcher",
    }.items():
        assert said in depot.json(words, code=2)["error"], words


def test_orders_are_recorded(depot: Depot) -> None:
    """By the monitor, as all else; and by the agent's own log."""
    depot.roco("param desk log-level info")
    log, key = depot.run / "logs" / "desk.jsonl", "/_/control/operator/desk"
    depot.wait(lambda: '"order":"log level info"' in log.read_text(), "it is in the agent's log")
    samples = lambda: recorded(depot.run, everything=True)  # noqa: E731
    depot.wait(lambda: any(one and key in one.key for one in samples()), "it is in the recording")


def test_only_the_operator_can_give_orders(depot: Depot) -> None:
    """An agent, and who only listens, put on the same key, and the router lets nothing of it
    through.
    """
    data = msgspec.msgpack.encode(Command("stolen", Pause()))
    for thief in ("console", "monitor", "ox"):
        with depot.session(thief) as session:
            for owner in ("operator", thief):
                session.put(f"roco/{depot.fleet.system}/_/control/{owner}/desk", data)
    depot.beats_on("desk")
    assert depot.beat("desk").answer.id != "stolen"
    assert depot.json("agent pause desk")["paused"] is True  # whereas the operator's key does
    depot.roco("agent start desk")


def test_logs_follow_what_is_written(depot: Depot) -> None:
    """-f shows what comes after it was called, until Ctrl-C, which is an ordinary end."""
    follows = depot.begin("logs -f desk --since 10m --format json")
    assert follows.stdout is not None
    orders = (json.loads(line)["fields"].get("order") for line in follows.stdout)
    assert next(orders) != "log level warning"  # it has begun to follow
    depot.roco("param desk log-level warning")
    assert "log level warning" in orders
    follows.send_signal(signal.SIGINT)
    assert follows.wait(20.0) == 0
