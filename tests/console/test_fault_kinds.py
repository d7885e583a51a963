"""When a fault begins, and when it is over: by what is seen of the process that was hit, and of the
one that takes its place. No real robot is hit.
"""

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from itertools import product
from pathlib import Path

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st
from typer.testing import CliRunner

from agent_runtime.io.tap import Sample
from companion.design import DESIGN
from console.__main__ import app
from console.errors import FleetError, UsageError
from console.faults import inflict, kinds, verbs
from console.faults.moments import (
    After,
    Event,
    InPlan,
    InState,
    Message,
    counter,
    moment_text,
    parse,
)
from console.fleet.process_status import Look, Seen
from console.output import Format
from operate.fault_lines import Fault
from operate.file_names import FAULTS_FILE
from operate.fleet_file import Fleet, ProcessState, ProcessStatus
from operate.live_lines import Happened, PlanAt, Step
from operate.proc import Used

PID, START = 40, 7
FAULT = Fault(id="kill-ox", kind="kill", target="ox", t=0.0, at="", pid=PID, start=START)


def test_another_process_that_lives_and_is_ready_is_back() -> None:
    """One that was killed is READY until its supervisor looks, and has nothing in use any more
    (`start` None).
    """
    for state, pid, start in product(ProcessState, (0, PID, PID + 1), (None, START, START + 1)):
        used = None if start is None else Used(0.0, 0, frozen=False, start=start)
        another = start is not None and (pid, start) != (PID, START)
        seen = Seen(ProcessStatus("ox", state, pid), used=used)
        assert kinds.back(seen, FAULT) == (another and state is ProcessState.READY), (
            state,
            pid,
            start,
        )


class Slow:
    """A fleet whose process stops at the third look after the signal, or never."""

    def __init__(self, looks: int) -> None:
        self.left, self.signals = looks, []

    def signal(self, name: str, number: int) -> None:
        """Note it."""
        self.signals.append((name, number))

    def look(self) -> Look:
        """Return the process, stopped or not yet."""
        self.left -= 1
        used = Used(0.0, 0, frozen=self.left < 0, start=START)
        return Look(
            None,
            (Seen(ProcessStatus("ox", ProcessState.READY, PID), used=used),),
            stop_held=False,
            at=0.0,
        )


def test_a_pause_has_begun_when_the_process_is_stopped() -> None:
    """Before, it counts as continued by another one."""
    fleet, pause = Slow(3), msgspec.structs.replace(FAULT, kind="pause")
    kinds.KINDS["pause"].begin(fleet, pause)
    assert fleet.signals == [("ox", signal.SIGSTOP)]
    assert kinds.KINDS["pause"].over(kinds.now(fleet, pause), pause) == ""


# --- A process that restarts is waited for at the moment of its fault. ----------------------------


class Restarting:
    """A fleet whose process has these states, a look each, and then runs."""

    where = "runs/x"

    def __init__(self, *states: ProcessState) -> None:
        self.states, self.signals, self.noted = list(states), [], []

    def signal(self, name: str, number: int) -> None:
        """Note it."""
        self.signals.append((name, number))

    def add_fault(self, line: bytes) -> None:
        """Note it."""
        self.noted.append(line)

    def look(self) -> Look:
        """Return the process, or the one in its place after a signal."""
        if self.states:
            status, used = ProcessStatus("ox", self.states.pop(0)), None
        else:
            pid = PID + len(self.signals)
            status = ProcessStatus("ox", ProcessState.READY, pid)
            used = Used(0.0, 0, frozen=False, start=START)
        return Look(None, (Seen(status, used=used),), stop_held=False, at=0.0)


@pytest.mark.parametrize(
    "state", [ProcessState.BACKING_OFF, ProcessState.STARTING, ProcessState.READY]
)
def test_a_process_that_restarts_is_hit_when_it_runs(state: ProcessState) -> None:
    """That of another kill, for example; one that was killed counts as ready for a moment."""
    fleet = Restarting(state, state, state)
    fault = inflict.planned(fleet, "kill", "ox", "")
    assert fault.pid == 0
    ended = inflict.Inflicting(fleet, fault).run(lambda: None, 0.0, lambda text: None)
    assert (ended.pid, ended.text) == (PID, "back")
    assert fleet.signals == [("ox", signal.SIGKILL)]


@pytest.mark.parametrize("state", [ProcessState.STOPPED, ProcessState.GIVEN_UP])
def test_a_process_that_nobody_restarts_does_not_run(state: ProcessState) -> None:
    """Neither at the order nor at the moment."""
    with pytest.raises(FleetError, match="ox does not run in runs/x; `roco agent start ox`"):
        inflict.planned(Restarting(state), "kill", "ox", "")
    fleet = Restarting(ProcessState.READY, state)
    fault = inflict.planned(fleet, "kill", "ox", "")
    with pytest.raises(FleetError, match="ox does not run"):
        inflict.Inflicting(fleet, fault).run(lambda: None, 0.0, lambda text: None)
    assert fleet.signals == []


# --- A repeated fault. ----------------------------------------------------------------------------


def ended_after(began: float, lasted: float) -> Fault:
    """A fault that is over."""
    return msgspec.structs.replace(FAULT, began=began, ended=began + lasted, text="back")


def test_a_repeated_fault_keeps_its_period(monkeypatch: pytest.MonkeyPatch) -> None:
    """From begin to begin; one that lasts longer delays the next, not those after it."""
    clock, begun, lasts = [100.0], [], [1.0, 25.0, 1.0, 1.0]

    def slept(seconds: float) -> None:
        clock[0] += seconds

    def once() -> Fault:
        begun.append(clock[0])
        clock[0] += lasts[len(begun) - 1]
        return ended_after(begun[-1], lasts[len(begun) - 1])

    monkeypatch.setattr(verbs.time, "sleep", slept)
    monkeypatch.setattr(verbs.time, "time", lambda: clock[0])
    verbs.repeat(once, once, 20.0, 4, Format.JSON)
    assert begun == [100.0, 120.0, 145.0, 160.0]


def test_the_figures_of_a_repeated_fault(capsys: pytest.CaptureFixture[str]) -> None:
    """How many of how many, how long; told where one fails, too."""
    faults = [ended_after(10.0, 1.0), ended_after(30.0, 3.0), ended_after(50.0, 2.0)]
    figures = verbs.repeated(4, faults)
    assert figures.words == (
        "3 of 4 done; lasted 2.0 s (median), 3.0 s (longest), 6.0 s of 42 s in all"
    )

    def fails() -> Fault:
        raise FleetError("ox is not back after 90 s")

    with pytest.raises(FleetError, match="not back"):
        verbs.repeat(fails, fails, 20.0, 15, Format.TEXT)
    assert capsys.readouterr().out == "0 of 15 done\n"


# --- No fault is done to a fleet whose back-end may move a real robot. ----------------------------


MODULE = "services.executor.loop"
LISTENS = "import sys; print(flush=True); sys.stdin.read()"


@pytest.fixture(params=["my_lab:make", "mock", None])
def backend(request: pytest.FixtureRequest) -> str | None:
    """A back-end as the environment names it."""
    name: str | None = request.param
    return name


@pytest.fixture
def loop(backend: str | None, tmp_path: Path) -> Iterator["subprocess.Popen[bytes]"]:
    """A process in place of the loop, in a run folder that says so."""
    environment = {name: value for name, value in os.environ.items() if name != "ROCO_BACKEND"}
    environment |= {"ROCO_BACKEND": backend} if backend else {}
    pipe = subprocess.PIPE
    command = [sys.executable, "-c", LISTENS, MODULE]
    with subprocess.Popen(command, env=environment, stdin=pipe, stdout=pipe) as process:
        assert process.stdout is not None
        process.stdout.readline()  # it runs, with its own environment
        status = ProcessStatus("loop", ProcessState.READY, process.pid, module=MODULE)
        told = Fleet("roco", "", 0, 0.0, (status,), entry="companion.tools.system:SYSTEM")
        (tmp_path / "fleet.json").write_bytes(msgspec.json.encode(told))
        yield process
        process.kill()


@pytest.mark.process
def test_only_simulated_robots(
    loop: "subprocess.Popen[bytes]", backend: str | None, tmp_path: Path
) -> None:
    """Any other back-end than the simulator and the mock: refused, before anything is noted."""
    words = ["fault", "pause", "loop", "--for", "0.1", "--run-dir", str(tmp_path)]
    done = CliRunner().invoke(app, words)
    if backend == "my_lab:make":
        assert done.exit_code == 1
        assert "the back-end my_lab:make may move a real robot" in done.stderr
        assert not (tmp_path / FAULTS_FILE).exists()
    else:
        assert done.exit_code == 0, done.stderr
        assert "pause loop: healed after 0.1 s" in done.stdout
    assert loop.poll() is None


# --- Moments of faults: what may be written for one, and when it is there. ------------------------


STATES = [(agent, one.name) for agent, entry in DESIGN.agents.items() for one in entry.state]
OWNERS = {state: [agent for agent, name in STATES if name == state] for _, state in STATES}


@given(st.floats(0, 1e6).map(lambda value: round(value, 3)), st.sampled_from(["", "s"]))
def test_seconds(value: float, unit: str) -> None:
    """A number is that many seconds."""
    assert parse(f"{value:.3f}{unit}", DESIGN, "pl") == After(value)


@given(
    st.integers(1, 10**6),
    st.sampled_from(["st", "nd", "rd", "th", ""]),
    st.sampled_from(["pl", "router"]),
)
def test_messages(count: int, ending: str, target: str) -> None:
    """Of an agent its own are counted, of another process all."""
    assert parse(f"{count}{ending}-message", DESIGN, target) == Message(
        count, "pl" if target == "pl" else ""
    )


@given(st.sampled_from(STATES), st.sampled_from([*DESIGN.agents, "router"]))
def test_states(named: tuple[str, str], target: str) -> None:
    """AGENT:STATE is that one's; a state alone is the target's, else the only one's, else it is
    asked whose.
    """
    agent, state = named
    assert parse(f"{agent}:{state}", DESIGN, target) == InState(agent, state)
    owners = OWNERS[state]
    if target in owners or len(owners) == 1:
        assert parse(state, DESIGN, target) == InState(
            target if target in owners else owners[0], state
        )
    else:
        with pytest.raises(UsageError, match=f"{owners[0]}:{state}"):
            parse(state, DESIGN, target)


names = st.from_regex(r"\A[a-z][a-z-]{0,7}\Z")
ids = st.lists(st.from_regex(r"\A[a-z]{1,5}_[1-9]\Z"), max_size=3, unique=True).map(tuple)


@given(names, ids, names, ids)
def test_an_event_is_there_by_its_name_and_what_it_is_of(
    name: str, of: tuple[str, ...], other: str, more: tuple[str, ...]
) -> None:
    """The first of them are enough; no text makes an event."""
    asked = " ".join((name, *of))
    event = parse(f"event:{asked}", DESIGN, "pl")
    assert event == Event(name, of)
    assert moment_text(event) == repr(asked)
    assert event.there(Happened(t=0.0, name=name, of=(*of, *more), text=other))
    assert event.there(Happened(t=0.0, name=other, of=of)) == (name == other)
    assert not event.there(Happened(t=0.0, name=f"{name}x", of=of, text=asked))
    assert not of or not event.there(Happened(t=0.0, name=name, of=("x_0", *of[1:])))
    assert not event.there(PlanAt(t=0.0, at=Step((name,), name, of)))


@given(
    names, ids, st.sampled_from(["", "Grasp", "Pour"]), names, st.sampled_from(["Grasp", "Pour"])
)
def test_a_step_of_a_plan_is_there_by_what_it_does(
    does: str, things: tuple[str, ...], act: str, other: str, acts: str
) -> None:
    """With its things, and in one of its acts; names of states do not count."""
    asked = " ".join((does, *things)) + (f"/{act}" if act else "")
    moment = parse(f"plan:{asked}", DESIGN, "pl")
    assert moment == InPlan(does, things, act)
    assert moment_text(moment) == repr(asked)
    at = Step((other, "1"), does, (*things, "lid_9"), "left", acts)
    assert moment.there(PlanAt(t=0.0, at=at)) == (act in ("", acts))
    assert not moment.there(PlanAt(t=0.0, at=at, outcome="failed"))
    assert not moment.there(PlanAt(t=0.0, at=Step((does,), f"{does}x", things, act=act)))
    assert not moment.there(PlanAt(t=0.0))
    assert not moment.there(Happened(t=0.0, name=does, of=things))


@given(st.text(max_size=12))
def test_anything_else_is_refused_in_words(text: str) -> None:
    """Never a traceback."""
    try:
        parse(text, DESIGN, "pl")
    except UsageError as error:
        assert text in str(error) or repr(text) in str(error)  # noqa: PT017


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("pl:flying", "pl has no state 'flying'; it has "),
        ("xx:idle", "no agent 'xx'; it has "),
        ("0th-message", "counted from 1"),
        ("event:", "names nothing; give seconds"),
        ("plan:/Grasp", "names no step; give seconds"),
        ("soon", "seconds \\(2.5\\), a time"),
    ],
)
def test_what_there_is_is_said(text: str, words: str) -> None:
    """Names of the design, or the forms."""
    with pytest.raises(UsageError, match=words):
        parse(text, DESIGN, "pl")


def spoken(sender: str, receiver: str) -> Sample:
    """A communicate as it goes by."""
    return Sample(f"roco/s/C4/{sender}/{receiver}/query/query-ref", b"", 1.0)


@given(
    st.lists(st.sampled_from([("pl", "km"), ("km", "pl"), ("ta", "ex"), ("_", "x")]), max_size=30),
    st.integers(1, 12),
)
def test_the_nth_message_is_counted(pairs: list[tuple[str, str]], count: int) -> None:
    """Communicates of others and other samples do not count."""
    there = counter(Message(count, "pl"))
    samples = [
        Sample("roco/s/_/ping/pl/km", b"", 1.0) if a == "_" else spoken(a, b) for a, b in pairs
    ]
    when = next((n for n, sample in enumerate(samples) if there(sample)), None)
    own = [n for n, pair in enumerate(pairs) if "pl" in pair]
    assert when == (own[count - 1] if len(own) >= count else None)


def test_a_state_is_there_when_it_is_told() -> None:
    """By that agent, in that state."""

    def beat(agent: str, state: str) -> Sample:
        told = msgspec.json.encode({"agent": agent, "state": state})
        return Sample(f"roco/s/_/state/{agent}", told, 1.0)

    there = counter(InState("pl", "idle"))
    for other in (beat("pl", "busy"), beat("km", "idle"), spoken("pl", "km")):
        assert not there(other)
    assert not there(Sample("roco/s/_/state/pl", b"\xff", 1.0))
    assert there(beat("pl", "idle"))
