"""`roco stop` in a folder without a fleet: every fleet of the user that lives is meant.

In a namespace of its own: fleets of other tests, which run at the same time, are not stopped.
"""

import os
import subprocess
import sys

import pytest

from agent_runtime.io.run_files import FLEET_VARIABLE, RUN_FOLDER_VARIABLE

pytestmark = pytest.mark.process
ALONE = ("unshare", "--pid", "--fork", "--kill-child", "--mount-proc")
INSIDE = f"""
import mmap, os, shutil, subprocess, sys
from pathlib import Path
LOOP = '''
import mmap, os, signal, sys, time
file = os.open("stop", os.O_RDWR | os.O_CREAT, 0o600)
os.pwrite(file, bytes(1), 0)
byte = mmap.mmap(file, 1)
print("mapped", flush=True)
while byte[:1] != bytes([1]):
    time.sleep(0.001)
print("held", flush=True)
signal.pause()  # a loop goes on when it is held
'''
here, gone, elsewhere = (Path(sys.argv[1]) / name for name in ("here", "gone", "elsewhere"))
elsewhere.mkdir()
loops = []

def roco(*words, **variables):
    command = [sys.executable, "-P", "-m", "console", *words]
    done = subprocess.run(
        command,
        cwd=elsewhere,
        env=os.environ | variables,
        capture_output=True,
        text=True,
        check=False,
    )
    print(done.returncode, done.stdout.strip(), done.stderr.strip(), sep="|")

def begin(run):
    run.mkdir(parents=True, exist_ok=True)
    (run / "loop.slots").touch()
    environment = os.environ | {{"{RUN_FOLDER_VARIABLE}": str(run), "{FLEET_VARIABLE}": run.name}}
    command = [sys.executable, "-P", "-c", LOOP]
    loop = subprocess.Popen(command, cwd=run, env=environment, stdout=subprocess.PIPE, text=True)
    loops.append(loop)
    assert loops[-1].stdout.readline() == "mapped\\n"

"""
ELSEWHERE = f"""{INSIDE}
roco("stop")
for run in (here, gone):
    begin(run)
shutil.rmtree(gone)
roco(*sys.argv[2:])
print([loop.stdout.readline().strip() for loop in loops])
"""
AMONG_SEVERAL = f"""{INSIDE}
dead = elsewhere / "runs/dead"
dead.mkdir(parents=True)
(dead / "loop.slots").touch()
(dead.parent / "latest").symlink_to("dead")
roco("stop")
for run in (dead.parent / "first", dead.parent / "second", here):
    begin(run)
roco("stop", {RUN_FOLDER_VARIABLE}=str(dead))
print([loop.stdout.readline().strip() for loop in loops[:2]])
print((here / "stop").read_bytes()[0])
roco("stop", "--target", str(here))
print(loops[2].stdout.readline().strip())
"""


def alone(program, *words):
    """What a program prints in a namespace of its own."""
    user = ["--user", "--map-root-user"] if os.geteuid() else []
    if subprocess.run(
        [ALONE[0], *user, *ALONE[1:], "true"], capture_output=True, check=False
    ).returncode:
        pytest.skip(
            "needs a process namespace (as root, in a container with CAP_SYS_ADMIN: scripts/test)"
        )
    environment = {name: value for name, value in os.environ.items() if name != RUN_FOLDER_VARIABLE}
    inside = [sys.executable, "-P", "-c", program, *words]
    command = [ALONE[0], *user, *ALONE[1:], *inside]
    done = subprocess.run(
        command, env=environment, capture_output=True, text=True, check=False, timeout=100
    )
    assert done.returncode == 0, done
    return done.stdout.splitlines()


def test_of_several_fleets_none_is_asked_for(tmp_path):
    """A run that has ended is not told to be stopped. All that run here are, whatever folder the
    shell names; the one elsewhere goes on, is named, and is stopped by its name.
    """
    nobody, *stopped, states, free, named, held = alone(AMONG_SEVERAL, str(tmp_path))
    assert nobody.startswith("3||roco: nothing was stopped: no fleet of yours runs on this"), nobody
    assert states == "['held', 'held']"
    told = "\n".join(stopped)
    for name in ("first", "second"):
        assert f"`roco release --target {tmp_path / 'elsewhere/runs' / name}`" in told
    here = tmp_path / "here"
    assert f"roco: not stopped: {here}; `roco stop --target {here}` stops it, too" in told
    assert (free, held) == ("0", "held")
    assert named.startswith("0|stopped: ")
    assert "not stopped" not in named


@pytest.mark.parametrize("words", [["stop"], ["say", "stój"]])
def test_a_stop_elsewhere_holds_the_robots_of_all_fleets(words, tmp_path):
    """Also of one whose folder was deleted; each is told with the command that releases it. Without
    any it fails.
    """
    nobody, *stopped, states = alone(ELSEWHERE, str(tmp_path), *words)
    assert nobody.startswith("3||roco: nothing was stopped: no fleet of yours runs on this"), nobody
    assert states == "['held', 'held']"
    told = "\n".join(stopped)
    assert told.startswith("0|stopped: the loop holds the robot until `roco release --target "), (
        told
    )
    for name in ("here", "gone"):
        assert f"until `roco release --target {tmp_path / name}`" in told
