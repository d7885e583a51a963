"""scripts/setup.sh chooses a Python that the lock serves, and everything that names Python versions
names the same.
"""

import os
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
SETUP = ROOT / "scripts/setup.sh"
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
HERE = "{}.{}".format(*sys.version_info[:2])


def bash(line: str, **variables: str) -> subprocess.CompletedProcess[str]:
    """What a line of bash says after setup.sh was read."""
    command = ["bash", "-c", f'source "{SETUP}"; {line}']
    environ = {"PATH": os.environ["PATH"], "HOME": os.environ.get("HOME", "/"), **variables}
    return subprocess.run(command, env=environ, capture_output=True, text=True, timeout=50)


def supported() -> list[str]:
    """The versions that setup.sh takes."""
    return bash('echo "${SUPPORTED[@]}"').stdout.split()


def interpreter(folder: Path, name: str, version: str, *, venv: bool = True) -> Path:
    """A program that answers setup.sh as a Python of this version does."""
    path, has = folder / name, "exit 0" if venv else "exit 1"
    answers = f'case "$3" in *version_info*) echo {version};; *venv*) {has};; esac'
    path.write_text(f'#!/bin/sh\n{answers}\n[ "$1" != --version ] || echo Python {version}\n')
    path.chmod(0o755)
    return path


def test_everything_names_the_same_versions() -> None:
    """pyproject.toml, README and requirements list what setup.sh takes, ruff and mypy check for the
    oldest.
    """
    versions = supported()
    oldest, newest = versions[0], versions[-1]
    beyond = "{}.{}".format(*(int(part) + k for k, part in enumerate(newest.split("."))))
    assert versions == sorted(versions, key=lambda version: int(version.split(".")[1]))
    assert PROJECT["requires-python"] == f">={oldest},<{beyond}"
    said = [line.rpartition(" ")[2] for line in PROJECT["classifiers"] if ":: Python :: 3." in line]
    assert said == versions
    listed = ", ".join(versions[:-1]) + f" or {newest}"
    assert f"Python {listed}" in (ROOT / "README.md").read_text()
    assert f"Python {listed}" in (ROOT / "requirements/README.md").read_text()
    codec = tomllib.loads((ROOT / "shared/fipa_codec/pyproject.toml").read_text())["project"]
    # one dependency with wheels for every version: no upper end
    assert codec["requires-python"] == f">={oldest}"


def test_images_have_a_supported_python() -> None:
    """Each file that names the base image names the same one."""
    named = {
        version
        for path in [*ROOT.glob("deploy/*"), ROOT / "docs/deploy.md", ROOT / "scripts/images.py"]
        if path.is_file()
        for version in re.findall(r"python:([0-9.]+)-slim", path.read_text(errors="ignore"))
    }
    assert len(named) == 1
    assert named <= set(supported())


def test_the_first_supported_python_is_taken(tmp_path: Path) -> None:
    """A newer one, an older one and one without venv are passed over."""
    versions = supported()
    interpreter(tmp_path, f"python{versions[0]}", versions[0], venv=False)
    interpreter(tmp_path, f"python{versions[1]}", "3.9")
    interpreter(tmp_path, "python3", "3.99")
    interpreter(tmp_path, "python", versions[2])
    only = f"PATH={tmp_path}; find_python"
    assert bash(only).stdout == "python\n"
    (tmp_path / "python").unlink()
    found = bash(only)
    assert (found.stdout, found.returncode) == ("", 1)


def test_the_project_is_found_from_a_folder_of_any_letters(tmp_path: Path) -> None:
    """An editable install names it; Python 3.11 and 3.12 read that in the letters of the locale,
    C's being ASCII.
    """
    root = tmp_path / "My Röbot"
    (root / "scripts").mkdir(parents=True)
    (root / "shared").mkdir()
    (root / "shared/found.py").touch()
    setup = shutil.copy(SETUP, root / "scripts")
    venv = [sys.executable, "-m", "venv", "--without-pip", root / ".venv"]
    subprocess.run(venv, timeout=50, check=True)
    (packages,) = root.glob(".venv/lib/python3.*/site-packages")
    named = packages / "_editable_impl_robot_companion.pth"
    named.write_text(f"{root}\n{root}/shared", encoding="utf-8")
    look = '.venv/bin/python -P -c "import found, sys; print(found.__file__.isascii())"'
    command = ["bash", "-c", f'source "{setup}"; relative_paths; {look}']
    env = {"PATH": os.environ["PATH"], "LC_ALL": "C"}
    done = subprocess.run(command, env=env, capture_output=True, text=True, timeout=50)
    assert (done.stdout, done.stderr) == ("False\n", "")


def test_a_named_python_must_be_supported(tmp_path: Path) -> None:
    """ROCO_PYTHON overrides the search; another version is refused with what would do."""
    newest = interpreter(tmp_path, "mine", supported()[-1])
    assert bash("find_python", ROCO_PYTHON=str(newest)).stdout == f"{newest}\n"
    future = interpreter(tmp_path, "future", "3.99")
    found = bash("find_python", ROCO_PYTHON=str(future))
    assert found.returncode == 2
    assert f"is Python 3.99, expected one of Python {' '.join(supported())}" in found.stderr


@pytest.mark.parametrize(
    ("runs", "made_for", "named", "fits"),
    [
        (HERE, HERE, None, True),
        (HERE, HERE, HERE, True),
        ("3.99", "3.99", None, False),  # no wheels
        (HERE, "3.10", None, False),  # the machine's python3 became another one
        (HERE, HERE, "3.99", False),
    ],
)
def test_an_environment_of_another_python_is_made_anew(
    tmp_path: Path, runs: str, made_for: str, named: str | None, fits: bool
) -> None:
    """By what .venv/bin/python is now, what it was when .venv was made, and ROCO_PYTHON."""
    (tmp_path / ".venv/bin").mkdir(parents=True)
    (tmp_path / ".venv/lib" / f"python{made_for}").mkdir(parents=True)
    interpreter(tmp_path / ".venv/bin", "python", runs)
    variables = {"ROCO_PYTHON": str(interpreter(tmp_path, "named", named))} if named else {}
    assert (bash(f'cd "{tmp_path}"; venv_fits', **variables).returncode == 0) == fits
