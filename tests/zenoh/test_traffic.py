"""`roco traffic`, `roco record` and `roco replay` over a real router: what goes by is counted, kept
and said again.
"""

import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from itertools import islice
from pathlib import Path
from typing import Any

import msgspec
import pytest
import zenoh

from agent_runtime.core.wiring import service_key
from agent_runtime.impersonation import LivingError, Stage
from agent_runtime.io.sessions import client_config, free_endpoint, open_router
from agent_runtime.io.steplog import StepLogs
from fipa_codec.communicate import decode, encode
from operate.cli.traffic.listen import HeardMessage, heard_message, recorded
from operate.cli.traffic.play import moved
from operate.file_names import FLEET_FILE
from operate.fleet_file import Fleet
from operate.recording import index, mcap_file
from operate.recording.contents import contents
from operate.recording.records import Spoken

pytestmark = pytest.mark.zenoh
POUR = Path(__file__).parents[1] / "histories" / "pour_seed_7"
ROCO = [sys.executable, "-m", "operate.cli"]
DEADLINE_S = 40.0


def _now(one: HeardMessage) -> HeardMessage:
    """The same, said now: what is long ago would be late."""
    communicate = one.communicate()
    assert communicate is not None
    return msgspec.structs.replace(
        one, data=encode(moved(communicate, one.at, time.time() + 5, None))
    )


SAID = [
    one
    for sample in recorded(POUR)
    if sample is not None and (one := heard_message(sample)) is not None
]
"""Communicates of a recorded run."""


class Router:
    """A router, a run folder that tells of it, and agents that say what was recorded."""

    def __init__(self, run: Path) -> None:
        self.run, self.endpoint = run, free_endpoint()
        told = Fleet(system="roco", connect=self.endpoint, supervisor=0, started=0.0, processes=())
        (run / FLEET_FILE).write_bytes(msgspec.json.encode(told))
        self._router = open_router(self.endpoint)
        self.session = zenoh.open(client_config(self.endpoint))
        self._logs = StepLogs(run)
        self.running: list[subprocess.Popen[bytes]] = []
        self.said: list[HeardMessage] = []

    def roco(self, *words: str) -> "subprocess.Popen[bytes]":
        """A verb, started; it hears what is said from when this comes back."""
        command = [*ROCO, *words, "--run-dir", str(self.run)]
        process = subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, cwd=self.run
        )
        self.running.append(process)
        ear = self.session.declare_publisher(service_key("roco", "state", "co"))
        wait_for(
            lambda: ear.matching_status.matching or process.poll() is not None, "somebody listens"
        )
        ear.undeclare()
        return process

    def say(self, count: int) -> None:
        """The first communicates of the recording, at once."""
        self.said = [_now(one) for one in SAID[:count]]
        for one in self.said:
            self._logs.passed(decode(one.data), time.time())

    def close(self) -> None:
        """End all of it."""
        for process in self.running:
            process.kill()
            process.communicate()
        self.session.close()  # type: ignore[no-untyped-call]
        self._router.close()  # type: ignore[no-untyped-call]


@pytest.fixture
def router(tmp_path: Path) -> Iterator[Router]:
    """Nothing but a router and the logs of agents that do not run."""
    made = Router(tmp_path)
    yield made
    made.close()


def wait_for(condition: Callable[[], object], what: str) -> None:
    """Look every 20 ms until the condition holds."""
    end = time.monotonic() + DEADLINE_S
    while not condition():
        assert time.monotonic() < end, f"not in {DEADLINE_S} s: {what}"
        time.sleep(0.02)


def told(process: "subprocess.Popen[bytes]", code: int = 0) -> list[Any]:
    """Return its output, a JSON object a line; its exit code must be `code`."""
    out, error = process.communicate(timeout=DEADLINE_S)
    assert process.returncode == code, error.decode()
    return [msgspec.json.decode(line) for line in out.splitlines()]


def test_echo_prints_what_is_meant_as_it_is_judged(router: Router) -> None:
    """All fields and the content; what the filter leaves out is heard by the judge all the same."""
    process = router.roco(
        "traffic", "echo", "--channel", "C3", "--agent", "pl", "--count", "2", "--format", "json"
    )
    router.say(40)
    request, agree = told(process)
    assert (request["sender"], request["performative"], request["verdict"]) == (
        "co",
        "request",
        "legal",
    )
    assert request["content"]["type"] == "GroundTaskNetwork"
    assert (agree["sender"], agree["performative"], agree["in_reply_to"]) == (
        "pl",
        "agree",
        request["reply_with"],
    )


def test_bw_counts_bytes_until_it_is_interrupted(router: Router) -> None:
    """Ctrl-C is the ordinary end: the last line has all that went by."""
    process = router.roco("traffic", "stats", "bw", "--format", "json")
    router.say(60)
    assert process.stdout is not None
    lines = iter(process.stdout.readline, b"")
    assert any(msgspec.json.decode(line)["count"] == 60 for line in lines)
    process.send_signal(signal.SIGINT)
    *_, last = (msgspec.json.decode(line) for line in lines)
    assert process.wait(DEADLINE_S) == 0
    assert sum(row["bytes"] for row in last["rows"]) == sum(one.size for one in SAID[:60])


def test_nobody_answers(router: Router) -> None:
    """Exit code 3, and what can be looked at instead."""
    router.close()
    process = subprocess.run(
        [*ROCO, "traffic", "stats", "hz", "--run-dir", str(router.run)],
        capture_output=True,
        timeout=DEADLINE_S,
        check=False,
    )
    assert process.returncode == 3
    assert b"--run" in process.stderr


def test_a_recording_has_what_is_meant(router: Router) -> None:
    """And nothing else; it is read by the other verbs."""
    file = router.run / "c4.mcap"
    count = sum(one.channel == "C4" for one in SAID[:80])
    process = router.roco(
        "record", "--out", str(file), "--channel", "C4", "--count", str(count), "--format", "json"
    )
    router.say(80)
    (done,) = told(process)
    assert (done["communicates"], done["file"], done["dropped"]) == (count, str(file), 0)
    kept = [
        one
        for sample in recorded(file)
        if sample is not None and (one := heard_message(sample)) is not None
    ]
    assert [one.data for one in kept] == [one.data for one in router.said if one.channel == "C4"]


def test_a_recording_is_ended_by_an_interrupt(router: Router) -> None:
    """Of the command alone, as `kill -INT` does; the file is closed in order."""
    file = router.run / "whole.mcap"
    process = router.roco("record", "--out", str(file), "--format", "json")
    router.say(20)
    wait_for(lambda: _kept(file) == 20, "all is flushed")
    process.send_signal(signal.SIGINT)
    (done,) = told(process)
    assert done["communicates"] == 20
    assert mcap_file.read(file).whole


def test_a_recorder_that_is_killed_leaves_a_recording(router: Router) -> None:
    """kill -9 of the command: what was flushed is there, and soon has its index."""
    file = router.run / "cut.mcap"
    process = router.roco("record", "--out", str(file))
    router.say(100)
    wait_for(lambda: _kept(file) == 100, "all is flushed")
    process.kill()
    process.wait(DEADLINE_S)
    wait_for(lambda: index.REPAIRED in contents(file).notes, "it is closed")
    assert _kept(file) == 100


def _kept(file: Path) -> int:
    return sum(isinstance(record, Spoken) for record in mcap_file.read(file).records)


def test_what_is_replayed_is_judged_as_it_was(router: Router) -> None:
    """On its own system name, with reply-by moved to now: nothing is late, and nothing is said to
    the fleet.
    """
    heard: list[str] = []
    fleet = router.session.declare_subscriber(
        "roco/roco/**", lambda sample: heard.append(str(sample.key_expr))
    )
    count = sum(one.channel != "C4" for one in SAID)
    only = [word for channel in ("C1", "C2", "C3", "C5", "C6") for word in ("--channel", channel)]
    words = [
        *ROCO,
        "replay",
        str(POUR),
        "--connect",
        router.endpoint,
        "--speed",
        "40",
        *only,
        "--format",
        "json",
    ]
    with subprocess.Popen(
        [*words, "--after", "8"], cwd=router.run, stdout=subprocess.PIPE
    ) as replaying:
        wait_for(
            lambda: list(router.run.glob(f"runs/replay-*/{FLEET_FILE}")),
            "the replay says where it is",
        )
        (folder,) = router.run.glob("runs/replay-*")
        process = subprocess.Popen(
            [*ROCO, "traffic", "echo", "--run-dir", str(folder), "--format", "json", "--count",
             str(count)],
            stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        )  # fmt: skip
        router.running.append(process)
        lines = told(process)
        out, _ = replaying.communicate(timeout=DEADLINE_S)
    replayed = msgspec.json.decode(out)
    assert replayed["communicates"] == count
    assert replayed["seconds"] >= replayed["recorded_s"] / 40
    assert {line["verdict"] for line in lines} <= {"legal", "slow"}
    assert all(abs(line["sent"] - line["t"]) < 10 for line in lines)
    assert heard == []
    fleet.undeclare()


def test_top_shows_the_traffic_of_a_replay(tmp_path: Path) -> None:
    """By the folder that the replay names; once it is over nothing of that folder is left."""
    command = [*ROCO, "replay", str(POUR), "--speed", "20", "--loop"]
    with subprocess.Popen(
        command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    ) as replaying:
        try:
            wait_for(
                lambda: list(tmp_path.glob("runs/replay-*/live.jsonl")),
                "the replay says where it is",
            )
            (folder,) = tmp_path.glob("runs/replay-*")
            wait_for(
                lambda: (folder / "live.jsonl").read_bytes().count(b'"channel":"C3"') > 4,
                "much was said again",
            )
            words = [*ROCO, "top", "--run-dir", str(folder), "--count", "1", "--format", "json"]
            done = subprocess.run(words, capture_output=True, timeout=DEADLINE_S, check=True)
        finally:
            replaying.send_signal(signal.SIGINT)
            replaying.wait(DEADLINE_S)
    channels = {one["name"]: one for one in msgspec.json.decode(done.stdout)["channels"]}
    assert channels["C3"]["count"] > 4
    assert channels["C3"]["per_s"] > 0
    assert not folder.exists()


def test_nothing_is_replayed_into_a_living_fleet(router: Router) -> None:
    """Nothing is said where an agent has its token, and it ends where one comes to life; both say
    who.
    """
    token = router.session.liveliness().declare_token(service_key("roco", "alive", "ta", "1"))
    words = [*ROCO, "replay", str(POUR), "--connect", router.endpoint, "--system", "roco"]
    done = subprocess.run(words, capture_output=True, timeout=DEADLINE_S, check=False)
    assert done.returncode == 1
    assert b"ta live" in done.stderr
    token.undeclare()
    stage = Stage("later", router.endpoint)
    stage.put("C1/co/ta/coordinate/request", b"")
    born = router.session.liveliness().declare_token(service_key("later", "alive", "ex", "1"))

    def refused() -> bool:
        try:
            stage.put("C1/co/ta/coordinate/request", b"")
        except LivingError as error:
            return error.agents == ("ex",)
        return False

    wait_for(refused, "it is seen")
    born.undeclare()
    stage.close()


def test_sniff_draws_what_goes_by_and_writes_it_at_the_end(router: Router) -> None:
    """Each communicate as it comes, live; Ctrl-C ends it in order, and the drawing has all of
    it.
    """
    process = router.roco("sniff", "--channel", "C2", "--channel", "C3", "--svg", "talk.svg")
    router.say(60)
    meant = [one for one in router.said if one.channel in ("C2", "C3")]
    assert process.stdout is not None
    lines = (line.decode() for line in iter(process.stdout.readline, b""))
    heading = next(lines)
    assert heading.split() == ["co", "pl", "hi"]
    drawn = list(islice((line for line in lines if "▶" in line or "◀" in line), len(meant)))
    assert sum(" C3 " in line for line in drawn) == sum(one.channel == "C3" for one in meant) > 0
    process.send_signal(signal.SIGINT)
    out, error = process.communicate(timeout=DEADLINE_S)
    assert process.returncode == 0, error.decode()
    assert f"wrote talk.svg: {len(meant)} of {len(meant)} arrows" in out.decode()
    assert (router.run / "talk.svg").read_text().count("<polygon") == len(meant)
