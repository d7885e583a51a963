"""The child that takes the camera's pictures finds the orders of the run by itself."""

from pathlib import Path

import pytest
from simulated import look_at

from companion.eyes import Eyes
from companion.look_around import POINTS
from services.executor.simulation import receptor
from velma.model.scene import load
from velma.sim import disturbances
from velma.sim.disturbances import Disturbance, Kind, Of
from velma.sim.mujoco_backend import MujocoBackend

pytestmark = [pytest.mark.process, pytest.mark.needs_opengl, pytest.mark.timeout(120)]


def test_a_black_camera_shows_nothing_until_it_is_well_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nothing is told to who looks but what is seen."""
    file = tmp_path / "disturbances.json"
    monkeypatch.setenv(disturbances.VARIABLE, str(file))
    backend, eye = MujocoBackend(load()), receptor(load(), Eyes.PIXELS)
    qpos = backend.configuration().copy()
    neck = look_at(backend.model, qpos, POINTS[0])
    try:
        well = {sight.name for sight in eye.look(qpos, neck)}
        disturbances.write(file, (Disturbance("a", Of.CAMERA, Kind.BLACK),))
        black = eye.look(qpos, neck)
        file.unlink()
        healed = {sight.name for sight in eye.look(qpos, neck)}
    finally:
        eye.close()
    assert well, "the look goes to where things are"
    assert black == []
    assert healed == well
