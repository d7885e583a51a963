"""The second worked example as processes over a real router: a robot that is killed drives on."""

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from depot_fleet import AGENTS, DESIGN_FILE, EXAMPLE, orders
from toy_fleet import wait_for

from agent_runtime.core.step import OUTSIDE
from agent_runtime.io.steplog import Deed, deeds
from fipa_codec.performatives import Performative
from topdown.model.design import load
from topdown.prove.paths import Follower

pytestmark = pytest.mark.zenoh


@pytest.fixture
def depot(tmp_path: Path) -> Iterator[Path]:
    """The depot, running; its run folder. What it printed is in `out` there."""
    (tmp_path / "orders.toml").write_text(orders(2))
    command = [sys.executable, "-m", "depot", "--run-dir", str(tmp_path), "--scene"]
    with (tmp_path / "out").open("wb") as out:
        process = subprocess.Popen(
            [*command, str(tmp_path / "orders.toml")], cwd=EXAMPLE, stdout=out, stderr=out
        )
    yield tmp_path
    process.send_signal(signal.SIGINT)
    assert process.wait(30.0) == 0
    left = [pid for pid in tmp_path.glob("*.pid") if pid.exists()]
    assert left == [], "all processes have ended"


def said(run: Path, *words: str) -> list[str]:
    """Lines of what was said that have all these words."""
    lines = (run / "out").read_text().splitlines()
    return [line for line in lines if all(word in line for word in words)]


def as_proven(run: Path) -> list[tuple[str, Deed]]:
    """No agent took a step that no row of the design allows, and all steps are of the model; the
    steps.
    """
    assert [log for log in (run / "logs").glob("*.jsonl") if OUTSIDE in log.read_text()] == []
    done = deeds(run / "steps")
    assert Follower(load(DESIGN_FILE)).follow(done) is None
    return done


def took(run: Path, who: str, act: Performative) -> bool:
    """Whether an agent's log says that it took one: a step is written a moment after it, and not by
    a kill -9.
    """
    return any(
        agent == who and deed.took is not None and deed.took[1] is act
        for agent, deed in deeds(run / "steps")
    )


def test_both_orders_are_delivered_though_the_robot_is_killed_on_its_way(depot: Path) -> None:
    """kill -9 while it drives, and of the router: it comes back and drives on; each thing is
    delivered once, each step is as proven, and no agent notices the outage of the router.
    """
    wait_for(
        lambda: said(depot, "mule -> dispatcher", "Carried(item='receiving')"),
        "the first is delivered",
    )
    wait_for(lambda: said(depot, "dispatcher -> ox", "accept-proposal"), "the second is under way")
    wait_for(
        lambda: took(depot, "ox", Performative.ACCEPT_PROPOSAL),
        "ox has written that it is under way",
    )
    for name in ("router", "ox"):
        os.kill(int((depot / f"{name}.pid").read_text()), signal.SIGKILL)
    wait_for(
        lambda: said(depot, "Delivered(item='store')"),
        f"the second is delivered\n{(depot / 'out').read_text()}",
    )
    assert len(said(depot, "-> desk", "Delivered(")) == 2
    assert len(said(depot, "accept-proposal")) == 2
    assert said(depot, "ox: backing-off")
    done = as_proven(depot)
    assert {agent for agent, _ in done} == set(AGENTS)
    events = [(agent, deed.event) for agent, deed in done]
    assert events.count(("desk", "PeerChanged dispatcher")) == 1, "the router is missed by no agent"
