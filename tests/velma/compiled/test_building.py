"""The library is built where a compiler is, carries its sources in its name, and is never
required.
"""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from velma import compiled

COMPILER = shutil.which("cc") or shutil.which("gcc")


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    """A folder with a copy of the package, not built."""
    (tmp_path / "velma").mkdir()
    (tmp_path / "velma/__init__.py").touch()
    ignored = shutil.ignore_patterns("*.so", "__pycache__")
    shutil.copytree(compiled.FOLDER, tmp_path / "velma/compiled", ignore=ignored)
    return tmp_path


def build(copy: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    """The result of `python -m velma.compiled` on the copy."""
    env = {**os.environ, "PYTHONPATH": str(copy), "PYTHONSAFEPATH": "1", **environment}
    command = [sys.executable, "-m", "velma.compiled"]
    return subprocess.run(
        command, env=env, cwd=copy, capture_output=True, text=True, timeout=50, check=False
    )


def libraries(copy: Path) -> list[str]:
    """Names of the libraries in the copy."""
    return sorted(path.name for path in (copy / "velma/compiled").glob("*.so"))


@pytest.mark.skipif(
    COMPILER is None, reason="needs a C compiler (Debian: apt install gcc libc6-dev)"
)
def test_changed_sources_are_built_again_and_the_old_library_goes(copy: Path) -> None:
    """Once for the same sources; the name is another one for others."""
    assert build(copy).returncode == 0
    (first,) = libraries(copy)
    made = (copy / "velma/compiled" / first).stat().st_mtime_ns
    assert build(copy, CC="/nowhere/cc").returncode == 0
    assert (copy / "velma/compiled" / first).stat().st_mtime_ns == made
    with (copy / "velma/compiled/near.c").open("a") as source:
        source.write("/* more */\n")
    assert build(copy).returncode == 0
    (second,) = libraries(copy)
    assert second != first


def test_without_a_compiler_it_is_said_and_nothing_is_built(copy: Path) -> None:
    """By name of what is missing or failed; the exit code is that of a failure."""
    missing = build(copy, PATH=str(copy), CC="")
    assert (missing.returncode, libraries(copy)) == (1, [])
    assert "apt install gcc" in missing.stderr
    failing = build(copy, CC="/nowhere/cc")
    assert (failing.returncode, libraries(copy)) == (1, [])
    assert "/nowhere/cc failed" in failing.stderr


def test_what_is_not_built_or_not_wanted_is_not_loaded(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """The plain code runs then."""
    monkeypatch.setattr(compiled, "FOLDER", tmp_path)
    assert compiled.library.__wrapped__() is None
    monkeypatch.undo()
    monkeypatch.setenv("ROCO_PLAIN", "1")
    assert compiled.library.__wrapped__() is None
