"""scripts/compose-test where there is no Docker, and what it says of a command that fails or does
not end.
"""

import importlib.util
import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

pytestmark = pytest.mark.process

SCRIPTS = Path(__file__).resolve().parents[2] / "scripts"


def containers():
    """scripts/containers.py, which is not in a package."""
    spec = importlib.util.spec_from_file_location("containers", SCRIPTS / "containers.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def program(folder, name, text):
    """An executable script."""
    path = folder / name
    path.write_text(f"#!/bin/sh\n{text}\n")
    path.chmod(0o755)


@pytest.fixture
def place(tmp_path, monkeypatch):
    """A folder that alone is on PATH."""
    monkeypatch.setenv("PATH", str(tmp_path))
    return tmp_path


def test_without_docker_it_says_loudly_that_nothing_is_tested(tmp_path):
    """A machine without Docker is not a failure."""
    done = subprocess.run(
        [sys.executable, SCRIPTS / "compose-test"],
        env={**os.environ, "PATH": str(tmp_path)},
        capture_output=True,
    )
    assert done.returncode == 0
    assert done.stdout.decode().startswith("SKIPPED: ")


def test_a_new_client_without_its_plugin_is_passed_over(tmp_path, monkeypatch):
    """It cannot build; an older one later on PATH can."""
    folders = [tmp_path / "first", tmp_path / "second"]
    for folder, number in zip(folders, ("28.2.2", "20.10.24"), strict=True):
        folder.mkdir()
        program(
            folder, "docker", f'case "$1" in version) echo {number};; buildx|compose) exit 1;; esac'
        )
    program(folders[1], "docker-compose", "")
    monkeypatch.setenv("PATH", os.pathsep.join(map(str, folders)))
    found = containers().find("p", {"ROCO_PORT": "1"})
    assert found.client == str(folders[1] / "docker")
    assert found.environment["PATH"].startswith(str(folders[1]))
    assert found.environment["ROCO_PORT"] == "1"


def test_compose_of_the_client_is_taken_first(place):
    """Version 2 where it is there."""
    program(place, "docker", "exit 0")
    found = containers().find("p", {})
    found.client = "unused"
    program(place, "docker", 'echo "$@"')
    assert found.compose("ps").split()[:3] == ["compose", "-p", "p"]


def test_a_client_without_any_compose_is_no_docker(place):
    """Nothing could be brought up."""
    program(place, "docker", 'case "$1" in version) echo 20.10.24;; compose) exit 1;; esac')
    assert containers().find("p", {}) is None


def test_a_failure_is_told_with_what_was_printed(place):
    """The command, its code, its words."""
    module = containers()
    program(place, "broken", "echo no space left; exit 3")
    with pytest.raises(module.Failed, match=r"broken: exit code 3\nno space left"):
        module.Docker("docker", ["compose"], "p", dict(os.environ)).run(["broken"], 10.0)


def test_what_does_not_end_is_ended(tmp_path):
    """And named, with how long it was waited for."""
    module = containers()
    docker = module.Docker("docker", ["compose"], "p", dict(os.environ))
    begun = time.monotonic()
    with pytest.raises(module.Failed, match="not done within 0 s"):
        docker.run([sys.executable, "-c", "import time; time.sleep(30)"], 0.2)
    assert time.monotonic() - begun < 20.0
