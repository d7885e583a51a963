"""A library in C is built where a compiler is, has its sources in its name, and is never needed."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import c_library
import velma.compiled
from c_library import CLibrary
from topdown.prove import compiled as explorer

COMPILER = shutil.which("cc") or shutil.which("gcc")
IGNORED = shutil.ignore_patterns("*.so", "__pycache__")
LIBRARIES = {"velma.compiled": velma.compiled.LIBRARY, "topdown.prove.compiled": explorer.LIBRARY}


class Copy:
    """A folder with the builder and one package of sources, as the build of images has it: not
    built, without the packages around it.
    """

    def __init__(self, folder: Path, package: str) -> None:
        self.folder, self.package = folder, package
        self.sources = folder.joinpath(*package.split("."))
        shutil.copytree(LIBRARIES[package].folder, self.sources, ignore=IGNORED)
        shutil.copytree(Path(c_library.__file__).parent, folder / "c_library", ignore=IGNORED)

    def build(self, **environment: str) -> subprocess.CompletedProcess[str]:
        """The result of `python -m PACKAGE`."""
        env = {**os.environ, "PYTHONPATH": str(self.folder), "PYTHONSAFEPATH": "1", **environment}
        command = [sys.executable, "-S", "-m", self.package]
        return subprocess.run(
            command, env=env, cwd=self.folder, capture_output=True, text=True, timeout=50
        )

    @property
    def built(self) -> list[Path]:
        """The libraries that are there."""
        return sorted(self.sources.glob("*.so"))


@pytest.fixture(params=LIBRARIES)
def copy(tmp_path: Path, request: pytest.FixtureRequest) -> Copy:
    """Of each package in turn."""
    return Copy(tmp_path, request.param)


@pytest.mark.skipif(
    COMPILER is None, reason="needs a C compiler (Debian: apt install gcc libc6-dev)"
)
def test_changed_sources_are_built_again_and_the_old_library_goes(copy: Copy) -> None:
    """Once for the same sources; the name is another one for others."""
    assert copy.build().returncode == 0
    (first,) = copy.built
    made = first.stat().st_mtime_ns
    assert copy.build(CC="/nowhere/cc").returncode == 0
    assert first.stat().st_mtime_ns == made
    with next(copy.sources.glob("*.c")).open("a") as source:
        source.write("/* more */\n")
    assert copy.build().returncode == 0
    (second,) = copy.built
    assert second != first


def test_without_a_compiler_it_is_said_and_nothing_is_built(copy: Copy) -> None:
    """By name of what is missing or failed; the exit code is that of a failure."""
    missing = copy.build(PATH=str(copy.folder), CC="")
    assert (missing.returncode, copy.built) == (1, [])
    assert "apt install gcc" in missing.stderr
    failing = copy.build(CC="/nowhere/cc")
    assert (failing.returncode, copy.built) == (1, [])
    assert "/nowhere/cc failed" in failing.stderr


@pytest.mark.parametrize("library", LIBRARIES.values(), ids=LIBRARIES)
def test_what_is_not_built_or_not_wanted_is_not_loaded(
    library: CLibrary, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """The plain code runs then."""
    assert library._replace(folder=tmp_path).load() is None
    monkeypatch.setenv("ROCO_PLAIN", "1")
    assert library.load() is None
