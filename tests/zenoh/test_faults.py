"""`roco fault` on a running depot: at a state and at a message, healed however the command ends,
and recorded.
"""

import contextlib
import json
import resource
import shutil
import signal
import subprocess
import time
from collections.abc import Iterator

import msgspec
import pytest
from depot_fleet import PATIENCE_S, Depot, running

from operate.fault_lines import Fault, read
from operate.fault_proxy import clocks
from operate.file_names import FAULTS_FILE, TRAFFIC_FILE
from operate.fleet_file import ProcessState
from operate.recording import mcap_file
from operate.recording.records import fault_in

pytestmark = [pytest.mark.zenoh, pytest.mark.timeout(150)]


@pytest.fixture(scope="module")
def _depot(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Depot]:
    with running(tmp_path_factory.mktemp("faults"), "--faults") as made:
        yield made


@pytest.fixture
def depot(_depot: Depot) -> Iterator[Depot]:
    """A depot that is up; no command outlives its test."""
    yield _depot
    _depot.leave()


def ended(process: "subprocess.Popen[str]", by: signal.Signals | None = None, code: int = 0) -> str:
    """Return what a verb printed up to its end, perhaps by a signal; its exit code must be
    `code`.
    """
    if by is not None:
        process.send_signal(by)
    out, problems = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == code, out + problems
    return out + problems


def hung(depot: Depot, name: str) -> "subprocess.Popen[str]":
    """Begin a hang of a process; it hangs, and stands in the file."""
    before = len(depot.faults())
    process = depot.begin("fault hang", name)
    depot.wait(
        lambda: len(depot.faults()) > before and depot.faults()[-1].began and depot.frozen(name),
        f"{name} hangs",
    )
    return process


def healed(depot: Depot) -> list[str]:
    """The processes that `fault list` heals."""
    return [one["target"] for one in depot.json("fault list")["healed"]]


def test_copies_of_what_an_agent_says_are_told_from_new_ones(depot: Depot) -> None:
    """Hundreds of them: the receiver lives on, and the judge finds copies, nothing else."""
    before = depot.pid("dispatcher")
    told = depot.roco("fault flood dispatcher --as mule --for 1")
    assert "flood dispatcher by 500 as mule: healed after 1 s" in told
    depot.wait(lambda: depot.judged("copy") > 100, "the copies are judged")
    assert depot.pid("dispatcher") == before


def test_an_agent_killed_in_a_state_comes_back(depot: Depot) -> None:
    """At a state that another agent tells; the band lasts until the new one is ready."""
    before, life = depot.pid("dispatcher"), depot.beat("dispatcher").incarnation
    told = depot.json("fault kill dispatcher --at mule:delivering")
    fault = msgspec.convert(told, Fault)
    assert (fault.at, fault.text, fault.pid) == ("mule:delivering", "back", before)
    assert depot.seen("dispatcher").status.state is ProcessState.READY
    assert (depot.pid("dispatcher") == before, depot.beat("dispatcher").incarnation) == (
        False, life + 1
    )  # fmt: skip
    assert fault.ended is not None
    assert 0 < fault.began < fault.ended


def test_ctrl_c_heals(depot: Depot) -> None:
    """The process goes on, and the file says so."""
    assert "interrupted" in ended(hung(depot, "traffic"), signal.SIGINT, 130)
    assert not depot.frozen("traffic")
    assert depot.faults()[-1].text == "broken off, healed"


def test_after_a_kill_of_the_command_the_next_list_heals(depot: Depot) -> None:
    """Until then the process hangs; a fault whose command lives is left alone by the list, and
    healed by `heal`.

    The monitor may hang for 20 s before its supervisor ends it.
    """
    ended(hung(depot, "monitor"), signal.SIGKILL, -signal.SIGKILL)
    assert depot.frozen("monitor")
    assert healed(depot) == ["monitor"]
    assert not depot.frozen("monitor")
    held = hung(depot, "monitor")
    assert healed(depot) == []
    assert depot.frozen("monitor")
    assert "hang monitor: healed" in depot.roco("fault heal")
    ended(held)
    assert not depot.frozen("monitor")


def test_a_process_is_kept_down_for_its_time(depot: Depot) -> None:
    """And is ready again when the command has ended."""
    process = depot.begin("fault kill ox --for 1")
    down = ProcessState.STOPPED
    depot.wait(lambda: depot.seen("ox").status.state is down, "ox is kept down")
    assert "down ox: healed after 1 s, back" in ended(process)
    assert depot.seen("ox").status.state is ProcessState.READY


def test_a_cut_takes_the_neighbours_away_and_a_healed_one_gives_them_back(depot: Depot) -> None:
    """The agent itself says so; the others go on, and no process is restarted."""

    def peers(name: str) -> set[str]:
        return {*depot.beat(name).peers}

    before, near = [depot.pid(name) for name in ("mule", "ox")], {"dispatcher", "traffic"}
    depot.wait(lambda: peers("mule") == near, "mule has its neighbours")
    process = depot.begin("fault cut mule --for 60")
    depot.wait(lambda: not peers("mule"), "mule has no neighbours")
    assert peers("ox") == near
    ended(process, signal.SIGTERM, 130)
    depot.wait(lambda: peers("mule") == near, "mule has its neighbours again")
    assert [depot.pid(name) for name in ("mule", "ox")] == before


@pytest.mark.parametrize(
    ("name", "text"), [("traffic", "healed after 3 s"), ("monitor", "it ended, back")]
)
def test_a_process_with_a_full_disk_writes_again_afterwards(
    depot: Depot, name: str, text: str
) -> None:
    """An agent waits for room; a recorder, which holds nobody up, ends and another one comes in its
    place.
    """
    process, old = depot.begin("fault disk-full --for 3", name), depot.pid(name)

    def limited() -> bool:
        with contextlib.suppress(ProcessLookupError):
            return resource.prlimit(old, resource.RLIMIT_FSIZE)[0] == 0
        return True

    depot.wait(limited, "its writes fail")
    assert f"disk-full {name}: {text}" in ended(process)
    assert depot.seen(name).status.state is ProcessState.READY
    soft, hard = resource.prlimit(depot.pid(name), resource.RLIMIT_FSIZE)
    assert soft == hard


def test_a_flood_of_orders_leaves_an_agent_that_obeys(depot: Depot) -> None:
    """It is the same one as before, and its log level, too."""
    before = depot.pid("desk")
    depot.roco("fault flood desk --per-second 200 --for 1")
    assert "info" in depot.roco("param desk log-level info")
    assert depot.pid("desk") == before


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

    before, process = depot.pid("mule"), depot.begin("fault clock mule 3600 --for 120")
    depot.wait(
        lambda: any(one.kind == "clock" and one.began for one in depot.faults()[-1:]),
        "it is stepped",
    )
    depot.roco("param mule log-level debug")
    assert (depot.pid("mule"), logs(0.0)) == (before, True)
    depot.roco("agent restart mule")
    depot.wait(lambda: logs(3600.0), "its next life logs an hour later")
    ended(process, signal.SIGINT, 130)
    depot.roco("agent restart mule")
    depot.wait(lambda: logs(0.0), "the life after it logs the right time")


def test_a_fault_begins_with_an_event_of_the_run(depot: Depot) -> None:
    """That of another fault."""
    process = depot.begin("fault pause ox --at event:fault")
    depot.wait(lambda: any(one.target == "ox" for one in depot.faults()[-1:]), "it waits")
    depot.roco("fault pause mule --for 0.2")
    assert "pause ox at 'fault': healed after 1 s" in ended(process)


def test_an_interrupted_scenario_heals_all_of_its_faults(depot: Depot) -> None:
    """Those that have begun, and those that wait for their moment never begin."""
    entry = '[[fault]]\nkind = "hang"\ntarget = "{}"\n'
    late = entry.format("desk") + "at = 100\n"
    (depot.folder / "two.toml").write_text(entry.format("mule") + entry.format("ox") + late)
    asked = len(depot.faults())
    process = depot.begin("fault run two.toml")
    depot.wait(lambda: depot.frozen("mule") and depot.frozen("ox"), "both hang")
    depot.wait(lambda: len(depot.faults()) == asked + 3, "the third waits")
    ended(process, signal.SIGTERM, 130)
    assert not any(map(depot.frozen, ("mule", "ox", "desk")))
    texts = {one.target: one.text for one in depot.faults()[asked:]}
    healed = "broken off, healed"
    assert texts == {"mule": healed, "ox": healed, "desk": "did not begin"}


def test_a_process_is_killed_again_and_again(depot: Depot) -> None:
    """Each kill is done, also where the process restarts when its fault is asked for; the list has
    them in the order of time.
    """
    told = depot.roco("fault kill ox --every 2 --times 3 --format json")
    *each, figures = map(json.loads, told.splitlines())
    assert [one["text"] for one in each] == ["back"] * 3
    assert (figures["asked"], figures["done"]) == (3, 3)
    assert 0 < figures["median_s"] <= figures["longest_s"] < figures["span_s"]
    entry = '[[fault]]\nkind = "kill"\ntarget = "ox"\nat = {}\n'
    (depot.folder / "often.toml").write_text("".join(map(entry.format, (4, 0, 2))))
    told = depot.roco("fault run often.toml")
    moments = [line.split()[3] for line in told.splitlines() if line.endswith("begun")]
    assert len(moments) == 3
    assert moments == sorted(moments)
    begun = [one["began"] for one in depot.json("fault list")["faults"] if one.get("began")]
    assert begun == sorted(begun)


REFUSED = {
    "flood desk --as ox": (2, "ox says nothing to desk; it talks with dispatcher, traffic"),
    "flood desk --as cow": (2, "'cow' is not an agent of depot"),
    "flood router": (2, "'router' is not an agent of depot"),
    "delay monitor 0.1": (1, "monitor has no wire; there are desk, "),
    # the fault before the stranger's does not begin, either
    "run wrong.toml": (2, "called 'cow'"),
    "kill ox --at 10000th-message --within 0.5": (1, "nothing was done"),
}
"""The rest of a call: its exit code, and what it says."""


def test_what_cannot_be_done_is_said_and_nothing_is_left_of_it(depot: Depot) -> None:
    """No fault began, and none goes on."""
    kill = '[[fault]]\nkind = "kill"\ntarget = "{}"\n'
    (depot.folder / "wrong.toml").write_text(kill.format("ox") + kill.format("cow"))
    begun = [one.id for one in depot.faults() if one.began]
    for call, (code, why) in REFUSED.items():
        assert why in depot.roco(f"fault {call}", code=code), call
        asked = [one for one in depot.faults() if one.id not in begun]
        assert [one for one in asked if one.began and one.ended is None] == [], call
        assert list(depot.run.glob("*.wire")) == [], call


def test_the_report_has_each_fault(depot: Depot) -> None:
    """Also one that was done to the monitor; those that did not begin are none. Then nothing can be
    hit any more.
    """
    depot.roco("fault kill monitor")
    depot.roco("down")
    report = json.loads((depot.run / "report.json").read_bytes())
    in_order = sorted(depot.faults(), key=lambda one: one.began)
    begun = [(one.kind, one.target, one.text) for one in in_order if one.began]
    assert [(one["kind"], one["target"], one["text"]) for one in report["faults"]] == begun
    assert ("kill", "monitor", "back") in begun
    records = mcap_file.read(depot.run / TRAFFIC_FILE).records
    recorded = [(one.id, one.t) for record in records if (one := fault_in(record)) is not None]
    assert recorded == [(one.id, one.t) for one in read((depot.run / FAULTS_FILE).read_bytes())]
    assert "Faults on purpose" in (depot.run / "report.html").read_text()
    assert "kill monitor" in depot.roco("fault list")
    depot.roco("fault kill ox", code=1)
