"""`roco fault` on a running depot: at a state and at a message, healed however the command ends,
and recorded.
"""

import contextlib
import json
import os
import resource
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgspec
import pytest
from toy_fleet import wait_for

from operate.cli.fleet.local import Local
from operate.cli.fleet.process_status import Seen
from operate.fault_lines import Fault, latest, read
from operate.fault_proxy import clocks
from operate.file_names import FAULTS_FILE
from operate.fleet_file import ProcessState
from operate.recording import mcap_file
from operate.recording.records import fault_in

pytestmark = [pytest.mark.zenoh, pytest.mark.timeout(150)]
EXAMPLE = Path(__file__).parents[2] / "examples" / "depot"
PATIENCE_S = 60.0


class Depot:
    """A depot in a folder of its own, that `roco` is called in."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.run = folder, folder / "run"
        self.begun: list[subprocess.Popen[str]] = []
        self.environment = {
            name: value for name, value in os.environ.items() if not name.startswith("ROCO_")
        }

    def begin(self, *words: str) -> "subprocess.Popen[str]":
        """Begin a verb."""
        command, pipe = [sys.executable, "-P", "-m", "operate.cli", *words], subprocess.PIPE
        process = subprocess.Popen(
            command,
            cwd=self.folder,
            env=self.environment,
            stdout=pipe,
            stderr=pipe,
            text=True,
            start_new_session=True,
        )
        self.begun.append(process)
        return process

    def end(self) -> None:
        """End what a failed test left running."""
        while self.begun:
            process = self.begun.pop()
            process.kill()
            process.communicate()

    def roco(self, *words: str, code: int = 0) -> str:
        """Return what a verb prints; its exit code must be `code`."""
        process = self.begin(*words)
        out, problems = process.communicate(timeout=120)
        assert process.returncode == code, out + problems
        return out + problems

    def faults(self) -> tuple[Fault, ...]:
        """Return the faults so far."""
        file = self.run / FAULTS_FILE
        return latest(read(file.read_bytes())) if file.exists() else ()

    def last(self) -> tuple[Fault, ...]:
        """The newest fault, or nothing: the file does not exist before the first one, and any test
        may run alone.
        """
        return self.faults()[-1:]

    def seen(self, name: str) -> Seen:
        """Return a process as it is now."""
        return next(one for one in Local(self.run).look().seen if one.name == name)

    def frozen(self, name: str) -> bool:
        """Whether a process is stopped by a signal."""
        used = self.seen(name).used
        return used is not None and used.frozen

    def judged(self, verdict: str) -> int:
        """Return how many communicates have a verdict so far."""
        return sum(one.verdict == verdict for one in Local(self.run).verdicts())

    def healed(self) -> list[str]:
        """The processes that `fault list` heals."""
        told: dict[str, Any] = json.loads(
            self.roco("fault", "list", "--run-dir", str(self.run), "--format", "json")
        )
        return [one["target"] for one in told["healed"]]

    def hung(self, name: str) -> "subprocess.Popen[str]":
        """Begin a hang of a process; it hangs, and stands in the file."""
        before = len(self.faults())
        process = self.begin("fault", "hang", name, "--run-dir", str(self.run))
        wait_for(
            lambda: len(self.faults()) > before and self.faults()[-1].began and self.frozen(name),
            f"{name} hangs",
            PATIENCE_S,
        )
        return process


@pytest.fixture(scope="module")
def depot(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Depot]:
    """A depot that is up; ended at the end, and reported."""
    folder = tmp_path_factory.mktemp("faults") / "depot"
    shutil.copytree(EXAMPLE, folder, ignore=shutil.ignore_patterns("runs", "__pycache__"))
    made = Depot(folder)
    try:
        made.roco("up", "--faults", "--out", str(made.run))
        yield made
    finally:
        made.roco("down", "--run-dir", str(made.run))
        made.end()


@pytest.fixture(autouse=True)
def ended(depot: Depot) -> Iterator[None]:
    """No command outlives its test."""
    yield
    depot.end()


def test_copies_of_what_an_agent_says_are_told_from_new_ones(depot: Depot) -> None:
    """Hundreds of them: the receiver lives on, and the judge finds copies, nothing else."""
    before = depot.seen("dispatcher").status.pid
    told = depot.roco(
        "fault", "flood", "dispatcher", "--as", "mule", "--for", "1", "--run-dir", str(depot.run)
    )
    assert "flood dispatcher by 500 as mule: healed after 1 s" in told
    wait_for(lambda: depot.judged("copy") > 100, "the copies are judged", PATIENCE_S)
    assert depot.seen("dispatcher").status.pid == before


def test_an_agent_killed_in_a_state_comes_back(depot: Depot) -> None:
    """At a state that another agent tells; the band lasts until the new one is ready."""
    before = depot.seen("dispatcher")
    told = depot.roco(
        "fault",
        "kill",
        "dispatcher",
        "--at",
        "mule:delivering",
        "--run-dir",
        str(depot.run),
        "--format",
        "json",
    )
    fault = msgspec.json.decode(told, type=Fault)
    after = depot.seen("dispatcher")
    assert (fault.at, fault.text, fault.pid) == ("mule:delivering", "back", before.status.pid)
    assert after.status.state is ProcessState.READY
    assert after.status.pid != before.status.pid
    assert after.beat is not None
    assert before.beat is not None
    assert after.beat.incarnation == before.beat.incarnation + 1
    assert fault.ended is not None
    assert 0 < fault.began < fault.ended


def test_ctrl_c_heals(depot: Depot) -> None:
    """The process goes on, and the file says so."""
    process = depot.hung("traffic")
    process.send_signal(signal.SIGINT)
    _, problems = process.communicate(timeout=PATIENCE_S)
    assert (process.returncode, "interrupted" in problems) == (130, True)
    assert not depot.frozen("traffic")
    assert depot.faults()[-1].text == "broken off, healed"


def test_after_a_kill_of_the_command_the_next_list_heals(depot: Depot) -> None:
    """Until then the process hangs; a fault whose command lives is left alone by the list, and
    healed by `heal`.

    The monitor may hang for 20 s before its supervisor ends it.
    """
    process = depot.hung("monitor")
    process.kill()
    process.communicate(timeout=PATIENCE_S)
    assert depot.frozen("monitor")
    assert depot.healed() == ["monitor"]
    assert not depot.frozen("monitor")
    held = depot.hung("monitor")
    assert depot.healed() == []
    assert depot.frozen("monitor")
    assert "hang monitor: healed" in depot.roco("fault", "heal", "--run-dir", str(depot.run))
    out, _ = held.communicate(timeout=PATIENCE_S)
    assert (held.returncode, depot.frozen("monitor")) == (0, False), out


def test_a_process_is_kept_down_for_its_time(depot: Depot) -> None:
    """And is ready again when the command has ended."""
    process = depot.begin("fault", "kill", "ox", "--for", "1", "--run-dir", str(depot.run))
    wait_for(
        lambda: depot.seen("ox").status.state is ProcessState.STOPPED, "ox is kept down", PATIENCE_S
    )
    out, problems = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 0, problems
    assert "down ox: healed after 1 s, back" in out
    assert depot.seen("ox").status.state is ProcessState.READY


def test_a_cut_takes_the_neighbours_away_and_a_healed_one_gives_them_back(depot: Depot) -> None:
    """The agent itself says so; the others go on, and no process is restarted."""

    def peers(name: str) -> set[str]:
        beat = depot.seen(name).beat
        return set() if beat is None else set(beat.peers)

    before = {name: depot.seen(name).status.pid for name in ("mule", "ox")}
    wait_for(
        lambda: peers("mule") == {"dispatcher", "traffic"}, "mule has its neighbours", PATIENCE_S
    )
    process = depot.begin("fault", "cut", "mule", "--run-dir", str(depot.run), "--for", "60")
    wait_for(lambda: not peers("mule"), "mule has no neighbours", PATIENCE_S)
    assert peers("ox") == {"dispatcher", "traffic"}
    process.send_signal(signal.SIGTERM)
    process.communicate(timeout=PATIENCE_S)
    wait_for(
        lambda: peers("mule") == {"dispatcher", "traffic"},
        "mule has its neighbours again",
        PATIENCE_S,
    )
    assert {name: depot.seen(name).status.pid for name in before} == before


@pytest.mark.parametrize(
    ("name", "text"), [("traffic", "healed after 3 s"), ("monitor", "it ended, back")]
)
def test_a_process_with_a_full_disk_writes_again_afterwards(
    depot: Depot, name: str, text: str
) -> None:
    """An agent waits for room; a recorder, which holds nobody up, ends and another one comes in its
    place.
    """
    process = depot.begin("fault", "disk-full", name, "--for", "3", "--run-dir", str(depot.run))
    old = depot.seen(name).status.pid

    def limited() -> bool:
        with contextlib.suppress(ProcessLookupError):
            return resource.prlimit(old, resource.RLIMIT_FSIZE)[0] == 0
        return True

    wait_for(limited, "its writes fail", PATIENCE_S)
    out, problems = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 0, problems
    assert f"disk-full {name}: {text}" in out
    now = depot.seen(name)
    soft, hard = resource.prlimit(now.status.pid, resource.RLIMIT_FSIZE)
    assert (now.status.state, soft) == (ProcessState.READY, hard)


def test_a_flood_of_orders_leaves_an_agent_that_obeys(depot: Depot) -> None:
    """It is the same one as before, and its log level, too."""
    before = depot.seen("desk")
    depot.roco(
        "fault", "flood", "desk", "--per-second", "200", "--for", "1", "--run-dir", str(depot.run)
    )
    assert "info" in depot.roco("param", "desk", "log-level", "info", "--run-dir", str(depot.run))
    after = depot.seen("desk")
    assert (after.status.pid, after.status.state) == (before.status.pid, ProcessState.READY)


@pytest.mark.parametrize(
    ("words", "why"),
    [
        (("desk", "--as", "ox"), "ox says nothing to desk; it talks with dispatcher, traffic"),
        (("desk", "--as", "cow"), "'cow' is not an agent of depot"),
        (("router",), "'router' is not an agent of depot"),
    ],
)
def test_a_flood_that_nobody_may_say_is_told(
    depot: Depot, words: tuple[str, ...], why: str
) -> None:
    """And nothing was done."""
    assert why in depot.roco("fault", "flood", *words, "--run-dir", str(depot.run), code=2)
    assert depot.faults()[-1].began == 0.0


@pytest.mark.skipif(
    shutil.which(clocks.COMPILER) is None,
    reason="needs a C compiler (Debian: apt install gcc libc6-dev)",
)
def test_the_clock_of_one_agent_is_stepped(depot: Depot) -> None:
    """A life goes on with even time, hears and is heard; one that begins meanwhile has the other
    time.
    """

    def logs(off_s: float) -> bool:
        """Whether what the agent logged last is so far from now."""
        line = (depot.run / "logs/mule.jsonl").read_text().splitlines()[-1]
        return bool(abs(json.loads(line)["t"] - time.time() - off_s) < 60.0)

    before = depot.seen("mule").status.pid
    process = depot.begin(
        "fault", "clock", "mule", "3600", "--for", "120", "--run-dir", str(depot.run)
    )
    wait_for(
        lambda: any(one.kind == "clock" and one.began for one in depot.last()),
        "it is stepped",
        PATIENCE_S,
    )
    depot.roco("param", "mule", "log-level", "debug", "--run-dir", str(depot.run))
    assert (depot.seen("mule").status.pid, logs(0.0)) == (before, True)
    depot.roco("agent", "restart", "mule", "--run-dir", str(depot.run))
    wait_for(lambda: logs(3600.0), "its next life logs an hour later", PATIENCE_S)
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=PATIENCE_S)
    depot.roco("agent", "restart", "mule", "--run-dir", str(depot.run))
    wait_for(lambda: logs(0.0), "the life after it logs the right time", PATIENCE_S)


def test_a_fault_begins_with_an_event_of_the_run(depot: Depot) -> None:
    """That of another fault."""
    process = depot.begin(
        "fault", "pause", "ox", "--at", "event:fault", "--run-dir", str(depot.run)
    )
    wait_for(lambda: any(one.target == "ox" for one in depot.last()), "it waits", PATIENCE_S)
    depot.roco("fault", "pause", "mule", "--for", "0.2", "--run-dir", str(depot.run))
    out, problems = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 0, problems
    assert "pause ox at 'fault': healed after 1 s" in out


def test_a_process_without_a_wire_is_told(depot: Depot) -> None:
    """And nothing is left of it."""
    words = ("fault", "delay", "monitor", "0.1", "--run-dir", str(depot.run))
    assert "monitor has no wire; there are desk, " in depot.roco(*words, code=1)
    assert depot.faults()[-1].ended is not None
    assert list(depot.run.glob("*.wire")) == []


def test_an_interrupted_scenario_heals_all_of_its_faults(depot: Depot) -> None:
    """Those that have begun, and those that wait for their moment never begin."""
    entry = '[[fault]]\nkind = "hang"\ntarget = "{}"\n'
    late = entry.format("desk") + "at = 100\n"
    (depot.folder / "two.toml").write_text(entry.format("mule") + entry.format("ox") + late)
    asked = len(depot.faults())
    process = depot.begin("fault", "run", "two.toml", "--run-dir", str(depot.run))
    wait_for(lambda: depot.frozen("mule") and depot.frozen("ox"), "both hang", PATIENCE_S)
    wait_for(lambda: len(depot.faults()) == asked + 3, "the third waits", PATIENCE_S)
    process.send_signal(signal.SIGTERM)
    _, problems = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 130, problems
    assert not any(map(depot.frozen, ("mule", "ox", "desk")))
    ended = {one.target: one.text for one in depot.faults()[asked:]}
    assert ended == {
        "mule": "broken off, healed",
        "ox": "broken off, healed",
        "desk": "did not begin",
    }


def test_a_scenario_that_names_a_stranger_does_nothing(depot: Depot) -> None:
    """Everything is looked at before the first fault begins."""
    (depot.folder / "wrong.toml").write_text(
        '[[fault]]\nkind = "kill"\ntarget = "ox"\n[[fault]]\nkind = "kill"\ntarget = "cow"\n'
    )
    asked = len(depot.faults())
    assert "called 'cow'" in depot.roco(
        "fault", "run", "wrong.toml", "--run-dir", str(depot.run), code=2
    )
    assert len(depot.faults()) == asked


def test_a_moment_that_does_not_come(depot: Depot) -> None:
    """Ends with 1, and nothing was done."""
    words = (
        "fault",
        "kill",
        "ox",
        "--at",
        "10000th-message",
        "--within",
        "0.5",
        "--run-dir",
        str(depot.run),
    )
    assert "nothing was done" in depot.roco(*words, code=1)
    assert depot.faults()[-1].began == 0.0


def test_the_report_has_each_fault(depot: Depot) -> None:
    """Also one that was done to the monitor; those that did not begin are none. Then nothing can be
    hit any more.
    """
    depot.roco("fault", "kill", "monitor", "--run-dir", str(depot.run))
    depot.roco("down", "--run-dir", str(depot.run))
    report = json.loads((depot.run / "report.json").read_bytes())
    in_order = sorted(depot.faults(), key=lambda one: one.began)
    begun = [(one.kind, one.target, one.text) for one in in_order if one.began]
    assert [(one["kind"], one["target"], one["text"]) for one in report["faults"]] == begun
    assert ("kill", "monitor", "back") in begun
    records = mcap_file.read(depot.run / mcap_file.FILE).records
    recorded = [(one.id, one.t) for record in records if (one := fault_in(record)) is not None]
    assert recorded == [(one.id, one.t) for one in read((depot.run / FAULTS_FILE).read_bytes())]
    assert "Faults on purpose" in (depot.run / "report.html").read_text()
    assert "kill monitor" in depot.roco("fault", "list", "--run-dir", str(depot.run))
    depot.roco("fault", "kill", "ox", "--run-dir", str(depot.run), code=1)
