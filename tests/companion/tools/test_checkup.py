"""What `roco doctor` says of this robot's own needs."""

import pytest

from companion.tools.verbs.checkup import CHECKS
from console.fleet.checkup import Level
from velma.errors import GlError
from velma.sim import gl


@pytest.mark.needs_opengl
def test_the_library_that_draws_is_named():
    """It drew."""
    (there,) = CHECKS.machine["OpenGL"]()
    assert there.level is Level.FINE
    assert there.what.startswith((gl.EGL, gl.OSMESA))


@pytest.mark.usefixtures("no_opengl")
def test_what_is_in_the_way_of_drawing_is_a_note():
    """With what to install, and no more than a note, since all but the camera works."""
    (gone,) = CHECKS.machine["OpenGL"]()
    assert gone.level is Level.NOTE
    assert "libEGL.so.1: file too short" in gone.what
    assert GlError.PACKAGES in gone.remedy
