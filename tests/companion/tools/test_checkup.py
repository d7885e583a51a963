"""What `roco doctor` says of this robot's own needs."""

import pytest

from companion.tools.verbs.checkup import CHECKS
from operate.cli.fleet.checkup import Level
from velma.sim import gl


def test_opengl_is_named_or_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    """By its library where it draws here; without it a note, since all but the camera works."""
    (there,) = CHECKS.machine["OpenGL"]()
    assert there.level is Level.FINE
    assert gl.found() in there.what
    monkeypatch.setenv("MUJOCO_GL", "off")
    (gone,) = CHECKS.machine["OpenGL"]()
    assert gone.level is Level.NOTE
    assert "libosmesa6" in gone.remedy
