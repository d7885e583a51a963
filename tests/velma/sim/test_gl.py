"""Whether something can be drawn here: by drawing, in another process. What is in the way is
told.
"""

import os
import re
import sys
from pathlib import Path

import pytest

from velma.errors import GlError
from velma.sim import gl

pytestmark = pytest.mark.process

ROOT = Path(__file__).resolve().parents[3]
NAMING = ("README.md", "docs/eyes.md", "docs/deploy.md", "scripts/errors.toml",
          "deploy/Dockerfile", "deploy/make-base")  # fmt: skip


@pytest.fixture
def broken(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder whose files are loaded in place of the machine's libraries."""
    monkeypatch.delenv("MUJOCO_GL", raising=False)
    monkeypatch.setenv("LD_LIBRARY_PATH", str(tmp_path))
    return tmp_path


def test_where_all_libraries_are_here_one_draws() -> None:
    """Which one is told. A check that always says no would have all tests that draw skipped: this
    one is not.
    """
    try:
        name = gl._chosen()
    except GlError:
        pytest.skip(f"needs OpenGL without a display (Debian: apt install {GlError.PACKAGES})")
    assert gl.required() == name
    assert gl.lost() == ""


@pytest.mark.usefixtures("no_opengl")
def test_libraries_that_cannot_be_loaded_are_named() -> None:
    """Both of them, and all packages of Debian."""
    both = r"libEGL\.so\.1: file too .* \S*libOSMesa\.so\.8: file too"
    with pytest.raises(GlError, match=both) as told:
        gl.required()
    assert GlError.PACKAGES in gl.lost()
    assert str(told.value) == gl.lost()


def test_egl_without_the_functions_of_opengl_does_not_draw(broken: Path) -> None:
    """EGL alone makes no context: that libraries can be loaded says too little."""
    for library in (gl.LIBRARIES[gl.OSMESA], *gl.FUNCTIONS):
        (broken / library).touch()
    assert gl.lost()


@pytest.mark.needs_opengl
def test_what_only_drawing_shows_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    """All libraries are there, and still nothing can be drawn."""
    for variable, value, why in (
        ("PYOPENGL_PLATFORM", "glx", "makes no context: ImportError: "),
        ("MESA_GL_VERSION_OVERRIDE", "1.1", "does not draw: OpenGL version 1.5 or higher required"),
        ("MUJOCO_GL", "off", "MUJOCO_GL=off in the environment forbids it"),
    ):
        with monkeypatch.context() as patch:
            patch.setenv(variable, value)
            assert why in gl.lost()


def test_a_driver_that_kills_or_hangs_is_survived(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Only the process that tried suffers."""
    program = tmp_path / "python"
    monkeypatch.setattr(sys, "executable", str(program))
    for script, within_s, why in (
        ("kill -SEGV $$", 20.0, "SIGSEGV killed the process"),
        ("exec sleep 60", 0.3, "nothing was drawn within 0.3 s"),
    ):
        program.write_text(f"#!/bin/sh\n{script}\n")
        program.chmod(0o755)
        monkeypatch.setattr(gl, "_WITHIN_S", within_s)
        assert why in gl.lost()


def test_an_answer_does_not_outlive_the_library(broken: Path) -> None:
    """It is asked each time: a library that breaks is noticed at once, and one that comes back,
    too.
    """
    before = gl.lost()
    for library in gl.LIBRARIES.values():
        (broken / library).touch()
    assert "file too short" in gl.lost()
    for library in gl.LIBRARIES.values():
        os.unlink(broken / library)
    assert gl.lost() == before


def test_who_names_packages_names_all() -> None:
    """As the error does; OSMesa is none of them: newer versions of Mesa do not have it."""
    for file in NAMING:
        words = set(re.findall(r"lib[a-z0-9-]+", (ROOT / file).read_text(encoding="utf-8")))
        assert set(GlError.PACKAGES.split()) <= words, file
        assert "libosmesa6" not in words, file
