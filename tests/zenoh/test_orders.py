"""Orders of the operator to agents that run: paused, resumed, their log level and parameters set,
over keys and rights.

The depot, brought up as anybody does; a robot is paused, a parameter of the dispatcher decides when
it gives up.
"""

import json
import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgspec
import pytest
import zenoh
from toy_fleet import wait_for

from agent_runtime.core.control import Command, Pause
from agent_runtime.io.secured import client_tls
from agent_runtime.io.sessions import client_config
from operate.cli.traffic.listen import recorded
from operate.file_names import LATEST, VERDICTS_FILE

pytestmark = [pytest.mark.zenoh, pytest.mark.timeout(120)]
ORDER = '[[order]]\nitem = "crate"\nsource = "store"\ntarget = "shipping"\n'
EXAMPLE = Path(__file__).parents[2] / "examples" / "depot"


class Depot:
    """The depot in a folder of its own."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.run = folder, folder / "runs" / LATEST
        self.environment = {
            name: value for name, value in os.environ.items() if not name.startswith("ROCO_")
        }

    def roco(self, *words: str, code: int = 0) -> dict[str, Any]:
        """Return the verb's JSON output; its exit code must be `code`."""
        command = [sys.executable, "-P", "-m", "operate.cli", *words, "--format", "json"]
        done = subprocess.run(
            command,
            cwd=self.folder,
            env=self.environment,
            capture_output=True,
            text=True,
            timeout=90,
        )
        assert done.returncode == code, done.stdout + done.stderr
        found: dict[str, Any] = json.loads(
            done.stdout.splitlines()[-1] if done.stdout else done.stderr
        )
        return found

    def beat(self, name: str) -> dict[str, Any]:
        """The last heartbeat of an agent."""
        found: dict[str, Any] = json.loads((self.run / f"{name}.heartbeat.json").read_bytes())
        return found

    def state(self, name: str) -> str:
        """The state that `roco agents` tells of an agent."""
        return next(
            str(row["state"]) for row in self.roco("agents")["agents"] if row["name"] == name
        )

    def said(self, text: str) -> int:
        """Return the number of the monitor's verdicts with a text."""
        file = self.run / VERDICTS_FILE
        return file.read_text().count(text) if file.exists() else 0


@pytest.fixture(scope="module")
def depot(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Depot]:
    """Running, with orders that come again and again."""
    folder = tmp_path_factory.mktemp("orders") / "depot"
    shutil.copytree(EXAMPLE, folder, ignore=shutil.ignore_patterns("runs", "__pycache__"))
    one = Depot(folder)
    try:
        orders = folder / "many.toml"
        orders.write_text("".join(ORDER for _ in range(60)))
        one.roco("up", "--scene", str(orders))
        yield one
    finally:
        one.roco("down")


def test_a_paused_agent_beats_takes_no_step_and_is_told_as_paused(depot: Depot) -> None:
    """Nothing restarts it, and what waits is taken once it is resumed."""
    depot.roco("agent", "pause", "mule")
    before = depot.beat("mule")
    assert depot.state("mule") == "paused"
    status = depot.roco("status")
    assert status["paused"] == ["mule"]
    wait_for(lambda: depot.beat("mule")["at"] > before["at"] + 2, "it beats on")
    now = depot.beat("mule")
    assert (now["pid"], now["state"], now["paused"]) == (before["pid"], before["state"], True)
    assert depot.roco("agent", "start", "mule")["paused"] is False
    wait_for(lambda: depot.beat("mule")["state"] != now["state"], "it goes on", 60.0)
    assert depot.state("mule") != "paused"


def test_a_pause_is_kept_over_a_kill(depot: Depot) -> None:
    """The next life is paused as the last one was."""
    depot.roco("agent", "pause", "traffic")
    before = depot.beat("traffic")
    os.kill(before["pid"], signal.SIGKILL)
    wait_for(
        lambda: depot.beat("traffic")["incarnation"] == before["incarnation"] + 1, "it is back"
    )
    assert depot.beat("traffic")["paused"] is True
    depot.roco("agent", "start", "traffic")


def test_the_log_level_is_changed_while_it_runs(depot: Depot) -> None:
    """The agent's output has no more of what it does, though it goes on; its log file has all of
    it.
    """
    out, file = depot.run / "ox.log", depot.run / "logs" / "ox.jsonl"
    assert depot.roco("param", "ox", "log-level", "error")["value"] == "error"
    silent, written = out.stat().st_size, file.stat().st_size
    wait_for(lambda: file.stat().st_size > written + 2000, "it goes on", 60.0)
    assert out.stat().st_size == silent
    assert depot.roco("param", "ox", "log-level", "debug")["value"] == "debug"
    wait_for(lambda: out.stat().st_size > silent, "it is told again", 60.0)


def test_a_parameter_decides_from_the_next_step_on(depot: Depot) -> None:
    """With both robots paused an order fails after as many calls as the parameter says; a restart
    keeps it.
    """
    assert depot.roco("param", "dispatcher", "rounds")["value"] == 20
    for robot in ("mule", "ox"):
        depot.roco("agent", "pause", robot)
    assert depot.roco("param", "dispatcher", "rounds", "1")["value"] == 1
    wait_for(lambda: depot.said("no robot was free in 1 calls"), "the order is given up", 60.0)
    assert depot.roco("agent", "restart", "dispatcher")["process"] == "ready"
    (rounds,) = depot.roco("param", "dispatcher")["parameters"]
    assert (rounds["value"], rounds["default"], rounds["allowed"]) == (
        1,
        20,
        "an integer from 1 to 1000",
    )
    for robot in ("mule", "ox"):
        depot.roco("agent", "start", robot)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (
            ("param", "dispatcher", "rounds", "0"),
            "rounds of dispatcher cannot be '0'; it is an integer from 1",
        ),
        (
            ("param", "dispatcher", "round", "5"),
            "dispatcher has no parameter 'round'; its parameters: rounds",
        ),
        (("param", "ox", "rounds"), "agent ox has no parameter 'rounds'; its parameters: none"),
        (
            ("agent", "pause", "router"),
            "'router' is not an agent of depot; its agents: desk, dispatcher",
        ),
    ],
)
def test_what_cannot_be_is_wrong_use(depot: Depot, words: tuple[str, ...], said: str) -> None:
    """Told in words, and nothing is sent."""
    assert said in depot.roco(*words, code=2)["error"]


def test_orders_are_recorded(depot: Depot) -> None:
    """By the monitor, as all else; and by the agent's own log."""
    depot.roco("param", "desk", "log-level", "info")
    lines = (depot.run / "logs" / "desk.jsonl").read_text
    wait_for(lambda: '"order":"log level info"' in lines(), "it is in the agent's log")

    def kept() -> bool:
        return any(
            one and "/_/control/operator/desk" in one.key
            for one in recorded(depot.run, everything=True)
        )

    wait_for(kept, "it is in the recording")


def test_only_the_operator_can_give_orders(depot: Depot) -> None:
    """An agent, and who only listens, put on the same key, and the router lets nothing of it
    through.
    """
    fleet = json.loads((depot.run / "fleet.json").read_bytes())
    data = msgspec.msgpack.encode(Command("stolen", Pause()))
    for thief in ("console", "monitor", "ox"):
        session = zenoh.open(client_config(fleet["connect"], client_tls(depot.run / "keys", thief)))
        for owner in ("operator", thief):
            session.put(f"roco/{fleet['system']}/_/control/{owner}/desk", data)
        session.close()  # type: ignore[no-untyped-call]
    before = depot.beat("desk")["at"]
    wait_for(lambda: depot.beat("desk")["at"] > before + 2, "it beats twice")
    assert depot.beat("desk")["answer"]["id"] != "stolen"
    assert depot.roco("agent", "pause", "desk")["paused"] is True  # whereas the operator's key does
    depot.roco("agent", "start", "desk")


def test_logs_follow_what_is_written(depot: Depot) -> None:
    """-f shows what comes after it was called, until Ctrl-C, which is an ordinary end."""
    command = [
        sys.executable,
        "-P",
        "-m",
        "operate.cli",
        "logs",
        "-f",
        "desk",
        "--since",
        "10m",
        "--format",
        "json",
    ]
    with subprocess.Popen(
        command, cwd=depot.folder, env=depot.environment, stdout=subprocess.PIPE
    ) as follows:
        assert follows.stdout is not None
        lines = map(json.loads, follows.stdout)
        assert next(lines)["fields"].get("order") != "log level warning"  # it has begun to follow
        depot.roco("param", "desk", "log-level", "warning")
        assert any(line["fields"].get("order") == "log level warning" for line in lines)
        follows.send_signal(signal.SIGINT)
        assert follows.wait(20.0) == 0
