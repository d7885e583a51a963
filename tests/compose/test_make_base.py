"""deploy/make-base leaves an image only where there is something to make it of."""

import shutil
import subprocess
from pathlib import Path

import pytest

pytestmark = pytest.mark.process

SCRIPT = Path(__file__).resolve().parents[2] / "deploy/make-base"
TOOLS = ("bash", "mktemp", "rm")


@pytest.fixture
def bin(tmp_path: Path) -> Path:
    """All programs there are: what the script needs of the shell, and a docker that notes what it
    was asked.
    """
    folder = tmp_path / "bin"
    folder.mkdir()
    for name in TOOLS:
        found = shutil.which(name)
        assert found
        (folder / name).symlink_to(found)
    program(folder / "docker", f'echo "$@" >> {tmp_path}/asked')
    return folder


def program(path: Path, script: str) -> None:
    """A program that does this."""
    path.write_text(f"#!/bin/sh\n{script}\n")
    path.chmod(0o755)


def made(bin: Path) -> subprocess.CompletedProcess[str]:
    """Run the script, and return its result."""
    environment = {"PATH": str(bin), "TMPDIR": str(bin.parent)}
    bash = shutil.which("bash")
    assert bash
    return subprocess.run(
        [bash, SCRIPT, "a/base:1"],
        env=environment,
        capture_output=True,
        text=True,
        timeout=30,
        check=False,
    )


def asked(bin: Path) -> str:
    """Return the command that docker got."""
    file = bin.parent / "asked"
    return file.read_text() if file.exists() else ""


def test_without_mmdebstrap_the_package_is_named(bin: Path) -> None:
    """And docker is asked for nothing."""
    done = made(bin)
    assert done.returncode == 2
    assert "apt install mmdebstrap" in done.stderr
    assert (done.stdout, asked(bin)) == ("", "")


def test_no_image_of_half_a_system(bin: Path) -> None:
    """mmdebstrap fails after it has written something: no image has the name, and no file is
    left.
    """
    program(bin / "mmdebstrap", 'for file; do :; done; echo half > "$file"; echo half; exit 25')
    done = made(bin)
    assert done.returncode == 1
    assert "no image was made" in done.stderr
    assert (done.stdout.replace("half\n", ""), asked(bin)) == ("", "")
    assert not list(bin.parent.glob("*.tar"))


def test_the_image_is_named(bin: Path) -> None:
    """The only output is the value that the caller gives to docker compose."""
    program(bin / "mmdebstrap", 'for file; do :; done; echo all > "$file"')
    done = made(bin)
    assert (done.returncode, done.stdout) == (0, "a/base:1\n")
    assert asked(bin).startswith("import ")
    assert asked(bin).endswith(" a/base:1\n")
    assert not list(bin.parent.glob("*.tar"))
