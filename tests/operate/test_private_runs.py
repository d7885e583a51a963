"""Run folders are closed to other users of the machine, whoever makes them; so are recordings
beside them.
"""

import os
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from synthetic import SYSTEM

from agent_runtime.io.run_files import make_run
from operate.recording.mcap_file import Recording
from operate.recording.recorder import Recorder
from operate.supervisor import folder
from services.executor.loop.link import LoopFile

NOBODY = 65534
MAKERS: dict[str, Callable[[Path], object]] = {
    "supervisor": folder.make,
    "recorder": lambda run: Recorder(run, SYSTEM).finish(),
    "loop": lambda run: LoopFile.create(run / "loop.slots"),
}


@pytest.fixture
def open_place() -> Iterator[Path]:
    """A folder that everybody may enter, and a umask that forbids nothing."""
    place = Path(tempfile.mkdtemp())
    place.chmod(0o755)
    before = os.umask(0)
    yield place
    os.umask(before)
    shutil.rmtree(place)


@pytest.mark.parametrize("maker", MAKERS)
def test_a_run_folder_is_its_owners_alone(open_place: Path, maker: str) -> None:
    """Also where the folders above it are made with it."""
    run = open_place / "runs" / "one"
    MAKERS[maker](run)
    assert any(run.iterdir())
    assert run.stat().st_mode & 0o777 == 0o700


def test_a_folder_that_is_there_keeps_its_mode(open_place: Path) -> None:
    """A folder that is shared on purpose stays shared."""
    run = open_place / "run"
    run.mkdir(mode=0o750)
    make_run(run)
    assert run.stat().st_mode & 0o777 == 0o750


@pytest.mark.process
@pytest.mark.skipif(os.geteuid() != 0, reason="needs root (as root: scripts/test)")
def test_another_user_is_refused(open_place: Path) -> None:
    """Neither the folder is listed nor the recording read, in it or beside it; the folder above is
    open.
    """
    run = open_place / "runs" / "one"
    Recorder(run, SYSTEM).finish()
    Recording(open_place / "mine.mcap").finish()
    for words in (
        ("ls", str(run)),
        ("cat", str(run / "traffic.mcap")),
        ("cat", str(open_place / "mine.mcap")),
    ):
        done = subprocess.run(words, user=NOBODY, capture_output=True, text=True, timeout=30)
        assert done.returncode != 0
        assert "Permission denied" in done.stderr
    above = ("ls", str(run.parent))
    assert subprocess.run(above, user=NOBODY, capture_output=True, timeout=30).returncode == 0
