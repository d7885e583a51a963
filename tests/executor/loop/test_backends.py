"""Back-ends by name: one that is not part of the project stands behind the loop, and what a wrong
name is told.
"""

import os
import signal
import sys

import msgspec
import numpy as np
import pytest
from loop_process import loop_process, seen, until
from typer.testing import CliRunner

from companion.skills.loop_messages import Phase, motion
from services.executor.loop.__main__ import app
from services.executor.loop.backends import SHORT, maker
from velma.errors import BackendError, NoRobotError
from velma.model import scene
from velma.names import START
from velma.sim.mock_backend import MockBackend
from velma.sim.mujoco_backend import MujocoBackend

MY_LAB = '''
from pathlib import Path

from velma.sim.mock_backend import MockBackend


class Marked(MockBackend):
    """Begins where no back-end of the project does; says at its end how many steps it took."""

    def __init__(self):
        super().__init__()
        self._steps = 0
        self.observe().q[0] = 0.25

    def step(self, command):
        super().step(command)
        self._steps += 1

    def close(self):
        Path("closed").write_text(str(self._steps))


make = Marked
for_scene = lambda scene: scene
half = object
def broken():
    raise OSError("no robot at 10.0.0.1")
def told_nothing():
    made = MockBackend()
    made.observe = lambda: {}
    return made
number = 5
'''


@pytest.fixture
def lab(tmp_path, monkeypatch):
    """A folder with a module of one's own, which is the current one."""
    (tmp_path / "my_lab.py").write_text(MY_LAB, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    yield tmp_path
    sys.modules.pop("my_lab", None)


def test_a_back_end_of_ones_own_runs_in_the_loop(lab):
    """`my_lab:make` in the folder of my_lab.py: its state is shown, a motion is done. It beats
    as it turns, ends at SIGTERM, and closes it. With PYTHONSAFEPATH, as the supervisor starts it.
    """
    own = {"ROCO_BACKEND": "my_lab:make", "PYTHONSAFEPATH": "1"}
    with loop_process(lab / "loop.slots", **own) as (child, agent):
        start = START + 0.25 * (np.arange(15) == 0)
        np.testing.assert_allclose(seen(agent).q, start, atol=1e-9)
        agent.send(motion("turn", start + np.linspace(0.0, 0.05, 50)[:, None] ** 2))
        done = ("turn", Phase.DONE)
        until(lambda: agent.beat() or (report(agent).key, report(agent).phase) == done)
        beat = lab / "loop.heartbeat.json"
        assert msgspec.json.decode(beat.read_bytes())["pid"] == child.pid
        os.utime(beat, (1.0, 1.0))
        until(lambda: beat.stat().st_mtime > 1.0)
        child.terminate()
        _, said = child.communicate(timeout=20)
    assert child.returncode == 0
    assert "my_lab:make" in said
    ended, _, cycles = said.rpartition(" after ")
    assert ended.endswith("ended by signal 15")
    assert (lab / "closed").read_text() == cycles.split()[0]


def report(agent):
    return agent.told().report


@pytest.mark.parametrize(("short", "kind"), [("mujoco", MujocoBackend), ("mock", MockBackend)])
def test_a_short_name_is_the_same_as_the_long_one(short, kind):
    """And the simulator stands in the scene that is asked for."""
    asked = scene.vary(scene.load(), 3)
    for name in (short, SHORT[short]):
        made = maker(name, asked)()
        assert type(made) is kind
        assert getattr(made, "scene", asked) is asked


@pytest.mark.parametrize(
    ("name", "found"),
    [
        ("", "Empty module name"),
        ("mujoko", "No module named 'mujoko'"),
        ("my_lab", "no attribute ''"),
        ("my_lab:mke", "no attribute 'mke'"),
        ("my_lab:number", "number is of type int"),
        ("my_lab:half", "made a object without period_s, observe, step, configuration, work_J"),
        ("my_lab:for_scene", "made a Scene without period_s"),
    ],
)
def test_a_wrong_name_is_told_what_is_wrong_what_is_right_and_what_to_do(lab, name, found):
    """Before anything is started for it."""
    with pytest.raises(BackendError) as caught:
        maker(name, scene.load())()
    said = str(caught.value)
    assert said.startswith(f"back-end {name!r}: ")
    assert found in said
    made = "made a" in found
    wanted = ("velma.sim.backend.Backend",) if made else SHORT
    assert all(word in said for word in wanted)
    assert ("docs/back-ends.md" if made else "mend the name") in said


def test_what_its_function_raises_is_told(lab):
    """The robot may answer later: an error of its own."""
    with pytest.raises(
        NoRobotError, match=r"my_lab:broken.*OSError: no robot at 10\.0\.0\.1.*answers"
    ):
        maker("my_lab:broken", scene.load())()


def test_a_state_of_another_kind_is_told_before_the_loop_reads_it(lab):
    """With what makes one."""
    with pytest.raises(BackendError, match=r"observe\(\) returned a dict.*at_rest\(\)"):
        maker("my_lab:told_nothing", scene.load())()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (
            ("--backend", "mujoko"),
            "loop: back-end 'mujoko': No module named 'mujoko', expected package.module:",
        ),
        (
            ("--scene", "nowhere.toml"),
            "loop: scene: file is 'nowhere.toml', expected the path of a",
        ),
    ],
)
def test_what_it_cannot_start_with_is_said_in_one_line(tmp_path, monkeypatch, words, said):
    """Exit code 2, with which no supervisor tries again."""
    monkeypatch.setattr(signal, "signal", lambda *_: None)
    ended = CliRunner().invoke(app, ["--slots", str(tmp_path / "s"), *words])
    assert ended.exit_code == 2
    assert ended.stderr.startswith(said)
    assert len(ended.stderr.splitlines()) == 1
