"""The operator's verbs on the real fleet: seen, stopped, started, restarted, drawn, frozen and
found out.
"""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from console.runs import folders

pytestmark = [pytest.mark.long, pytest.mark.process, pytest.mark.timeout(400)]
VERB_S = 150.0
ROCO = (sys.executable, "-m", "console")


def roco(run: Path, *words: str, code: int = 0) -> dict[str, Any]:
    """Return the verb's JSON output; its exit code must be `code`."""
    command = [*ROCO, *words, "--run-dir", str(run), "--format", "json"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=VERB_S)
    assert done.returncode == code, done.stdout + done.stderr
    found: dict[str, Any] = json.loads(done.stdout or done.stderr)
    return found


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """One fleet for all of it, as fast as it goes."""
    folder = tmp_path_factory.mktemp("operated") / "run"
    up = [*ROCO, "up", "--out", str(folder), "--speed", "max"]
    try:
        subprocess.run(up, check=True, timeout=VERB_S)
        yield folder
    finally:
        subprocess.run([*ROCO, "down", "--run-dir", str(folder)], timeout=VERB_S)


def rows(run: Path, code: int = 0) -> dict[str, dict[str, Any]]:
    """The processes by name."""
    return {row["name"]: row for row in roco(run, "agents", code=code)["agents"]}


def test_every_process_is_seen(run: Path) -> None:
    """Eleven, each with memory; agents with their state, first life, and a heartbeat."""
    found, agents = rows(run), {"km", "pl", "ta", "ex", "co", "hi"}
    assert set(found) == agents | {"forks", "router", "monitor", "loop", "page"}
    assert all(row["memory"] > 10 << 20 for row in found.values())
    assert (found["km"]["state"], found["km"]["incarnation"]) == ("idle", 1)
    assert all(found[name]["heartbeat_s"] < 10 for name in agents)


def test_a_stopped_agent_stays_down_until_it_is_started(run: Path) -> None:
    """The others live on; the status says who is down, and its next life counts on."""
    roco(run, "agent", "stop", "km")
    processes = roco(run, "status", code=1)["fleet"]["processes"]
    assert [one["name"] for one in processes if one["state"] != "ready"] == ["km"]
    assert "roco agent start km" in json.dumps(roco(run, "doctor", code=1))
    roco(run, "agent", "start", "km")
    row = rows(run)["km"]
    assert (row["process"], row["incarnation"], row["restarts"]) == ("ready", 2, 0)


def test_a_restarted_agent_is_another_process(run: Path) -> None:
    """Ready again when the verb comes back."""
    before = rows(run)["pl"]["pid"]
    after = roco(run, "agent", "restart", "pl")
    assert after["process"] == "ready"
    assert after["pid"] != before
    assert rows(run)["pl"]["incarnation"] == 2


def test_a_frozen_process_is_found_out_and_a_restart_helps(run: Path) -> None:
    """Doctor names it with a remedy, and the remedy works. The supervisor, which would do the same,
    is frozen, too.
    """
    told = folders.fleet(run)
    assert told is not None
    os.kill(told.supervisor, signal.SIGSTOP)
    try:
        os.kill(rows(run)["ta"]["pid"], signal.SIGSTOP)
        assert rows(run, code=1)["ta"]["trouble"] == "frozen by a signal"
        checks = {check["name"]: check for check in roco(run, "doctor", code=1)["checks"]}
        assert "roco agent restart ta" in checks["ta"]["remedy"]
        assert "frozen by a signal" in checks["supervisor"]["what"]
    finally:
        os.kill(told.supervisor, signal.SIGCONT)
    roco(run, "agent", "restart", "ta")
    assert rows(run)["ta"]["trouble"] == ""


def test_the_graph_has_what_was_said(run: Path) -> None:
    """After a sentence channel C2 has traffic."""
    roco(run, "say", "status")
    roco(run, "say", "look around")
    assert roco(run, "top", "--once")["task"]["said"] == "look around"
    channels = roco(run, "top", "--graph", "--once")["channels"]
    assert {one["name"]: one["count"] for one in channels}["C2"] > 0
