"""A whole pour with good senses, eyes by pixels: no look of it tells that a sense is not well."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))

from pour_one_process import Run

from companion.languages import rc
from companion.skills.skill import Sensed
from services.executor.simulation import InProcess
from velma.model.scene import load, vary


class Watched(InProcess):
    """A body that keeps what each look told of the camera and the encoders of the neck."""

    def __init__(self, of: InProcess) -> None:
        super().__init__(of.core, of.eye)
        self.told: list[tuple[str, float]] = []

    def sensed(self) -> Sensed:
        """Look, also during a motion."""
        sensed = super().sensed()
        self.told.append((sensed.wrong, sensed.off))
        return sensed


class Kept(Run):
    """A run that keeps what each act told of its senses."""

    ill: tuple[rc.Ill, ...] = ()

    def act(self, command: rc.Command) -> rc.Done | rc.NotDone:
        """Perform a command."""
        outcome = super().act(command)
        self.ill += outcome.ill
        return outcome


@pytest.mark.process
@pytest.mark.needs_opengl
@pytest.mark.timeout(600)
def test_a_good_pour_raises_no_alarm() -> None:
    """Canonical scene, seed 4."""
    run = Kept(vary(load(), 4), 4)
    try:
        run.body = watched = Watched(run.body)
        assert run.pour() == ()
    finally:
        run.body.eye.close()
    assert len(watched.told) > 20
    assert set(watched.told) == {("", 0.0)}
    assert run.ill == ()
