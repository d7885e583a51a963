"""`roco traffic`, `roco record` and `roco replay` over a real router: what goes by is counted, kept
and said again.
"""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from typing import Any

import msgspec
import pytest
import zenoh
from toy_fleet import wait_for

from agent_runtime.core.wiring import service_key
from agent_runtime.impersonation import LivingError, Stage
from agent_runtime.io.sessions import client_config, free_endpoint, open_router
from agent_runtime.io.steplog import StepLogs
from console.traffic.listen import HeardMessage, heard_message, recorded
from console.traffic.play import moved
from fipa_codec.communicate import decode, encode
from operate.file_names import FLEET_FILE, LIVE_FILE
from operate.fleet_file import Fleet
from operate.recording import index, mcap_file
from operate.recording.contents import contents
from operate.recording.records import Spoken

pytestmark = pytest.mark.zenoh
POUR = Path(__file__).parents[1] / "histories" / "pour_seed_7"
ROCO = [sys.executable, "-m", "console"]
DEADLINE_S = 40.0


def _now(one: HeardMessage) -> HeardMessage:
    """The same, said now: what is long ago would be late."""
    communicate = one.communicate()
    assert communicate is not None
    now = moved(communicate, one.at, time.time() + 5, None)
    return msgspec.structs.replace(one, data=encode(now))


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
        self.about, self.environment = ["--run-dir", str(run)], dict(os.environ)

    def begin(self, *words: str) -> "subprocess.Popen[bytes]":
        """Begin a verb; the first text may have several words."""
        command, pipe = [*ROCO, *words[0].split(), *words[1:]], subprocess.PIPE
        process = subprocess.Popen(
            command, stdout=pipe, stderr=pipe, cwd=self.run, env=self.environment
        )
        self.running.append(process)
        return process

    def roco(self, *words: str) -> "subprocess.Popen[bytes]":
        """A verb about the fleet, started; it hears what is said from when this comes back."""
        process = self.begin(*words, *self.about)
        wait_for(lambda: self.heard() or process.poll() is not None, "somebody listens")
        return process

    def heard(self) -> bool:
        """Whether anybody hears what is said."""
        ear = self.session.declare_publisher(service_key("roco", "state", "co"))
        matching = ear.matching_status.matching
        ear.undeclare()
        return matching

    def say(self, count: int) -> None:
        """The first communicates of the recording, at once."""
        self.said = [_now(one) for one in SAID[:count]]
        for one in self.said:
            self._logs.passed(decode(one.data), time.time())

    def meant(self, *channels: str) -> list[bytes]:
        """What was said on these channels."""
        return [one.data for one in self.said if one.channel in channels]

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


def told(process: "subprocess.Popen[bytes]", code: int = 0) -> list[Any]:
    """Return its output, a JSON object a line; its exit code must be `code`."""
    out, error = process.communicate(timeout=DEADLINE_S)
    assert process.returncode == code, error.decode()
    return [msgspec.json.decode(line) for line in out.splitlines()]


def refused(process: "subprocess.Popen[bytes]", code: int, words: str) -> None:
    """A verb ends with this exit code, and says why."""
    _, error = process.communicate(timeout=DEADLINE_S)
    assert (process.returncode, words in error.decode()) == (code, True), error.decode()


def interrupted(process: "subprocess.Popen[bytes]") -> list[Any]:
    """Return the rest of its output after Ctrl-C, the ordinary end."""
    process.send_signal(signal.SIGINT)
    return told(process)


def kept(file: Path) -> list[bytes]:
    """The communicates in a recording."""
    return [one.wire for one in mcap_file.read(file).records if isinstance(one, Spoken)]


def test_echo_prints_what_is_meant_as_it_is_judged(router: Router) -> None:
    """All fields and the content; what the filter leaves out is heard by the judge all the same."""
    process = router.roco("traffic echo --channel C3 --agent pl --count 2 --format json")
    router.say(40)
    request, agree = told(process)
    fields = ("sender", "performative", "verdict")
    assert [request[name] for name in fields] == ["co", "request", "legal"]
    assert request["content"]["type"] == "GroundTaskNetwork"
    assert [agree[name] for name in fields] == ["pl", "agree", "legal"]
    assert agree["in_reply_to"] == request["reply_with"]


def test_bw_counts_bytes_until_it_is_interrupted(router: Router) -> None:
    """The last line has all that went by."""
    process = router.roco("traffic stats bw --format json")
    router.say(60)
    assert process.stdout is not None
    lines = iter(process.stdout.readline, b"")
    assert any(msgspec.json.decode(line)["count"] == 60 for line in lines)
    last = interrupted(process)[-1]
    assert sum(row["bytes"] for row in last["rows"]) == sum(one.size for one in SAID[:60])


def test_nobody_answers(router: Router) -> None:
    """Exit code 3, and what can be looked at instead."""
    router.close()
    refused(router.begin("traffic stats hz", *router.about), 3, "--run")


def test_a_recording_has_what_is_meant(router: Router) -> None:
    """And nothing else; it is read by the other verbs."""
    file, count = router.run / "c4.mcap", sum(one.channel == "C4" for one in SAID[:80])
    process = router.roco(f"record --channel C4 --count {count} --format json --out", str(file))
    router.say(80)
    (done,) = told(process)
    assert (done["communicates"], done["file"], done["dropped"]) == (count, str(file), 0)
    heard = [heard_message(one) for one in recorded(file) if one is not None]
    assert [one.data for one in heard if one is not None] == router.meant("C4")


def test_a_recording_is_ended_by_an_interrupt(router: Router) -> None:
    """Of the command alone, as `kill -INT` does; the file is closed in order."""
    file = router.run / "whole.mcap"
    process = router.roco("record --format json --out", str(file))
    router.say(20)
    wait_for(lambda: len(kept(file)) == 20, "all is flushed")
    (done,) = interrupted(process)
    assert done["communicates"] == 20
    assert mcap_file.read(file).whole


def test_a_recorder_that_is_killed_leaves_a_recording(router: Router) -> None:
    """kill -9 of the command: what was flushed is there, and soon has its index."""
    file = router.run / "cut.mcap"
    process = router.roco("record --out", str(file))
    router.say(100)
    wait_for(lambda: len(kept(file)) == 100, "all is flushed")
    process.kill()
    process.wait(DEADLINE_S)
    wait_for(lambda: index.REPAIRED in contents(file).notes, "it is closed")
    assert len(kept(file)) == 100


def replaying(router: Router, *words: str) -> "tuple[subprocess.Popen[bytes], Path]":
    """Begin a replay of the pour; return it, and the folder that says where it is."""
    process = router.begin(f"replay {POUR}", *words)
    folders = lambda: [one.parent for one in router.run.glob("runs/replay-*/fleet.json")]  # noqa: E731
    wait_for(folders, "the replay says where it is")
    return process, folders()[0]


def test_what_is_replayed_is_judged_as_it_was(router: Router) -> None:
    """On its own system name, with reply-by moved to now: nothing is late, and nothing is said to
    the fleet.
    """
    heard: list[str] = []
    fleet = router.session.declare_subscriber(
        "roco/roco/**", lambda sample: heard.append(str(sample.key_expr))
    )
    count = sum(one.channel != "C4" for one in SAID)
    only = " ".join(f"--channel {channel}" for channel in ("C1", "C2", "C3", "C5", "C6"))
    options = f"--speed 40 --format json --after 8 {only} --connect {router.endpoint}"
    process, folder = replaying(router, *options.split())
    lines = told(router.begin(f"traffic echo --format json --count {count} --run-dir {folder}"))
    (replayed,) = told(process)
    assert replayed["communicates"] == count
    assert replayed["seconds"] >= replayed["recorded_s"] / 40
    assert {line["verdict"] for line in lines} <= {"legal", "slow"}
    assert all(abs(line["sent"] - line["t"]) < 10 for line in lines)
    assert heard == []
    fleet.undeclare()


def test_top_shows_the_traffic_of_a_replay(router: Router) -> None:
    """By the folder that the replay names; once it is over nothing of that folder is left."""
    process, folder = replaying(router, "--speed", "20", "--loop")
    live = folder / LIVE_FILE
    wait_for(
        lambda: live.exists() and live.read_bytes().count(b'"channel":"C3"') > 4, "much was said"
    )
    (top,) = told(router.begin(f"top --count 1 --format json --run-dir {folder}"))
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=DEADLINE_S)
    channels = {one["name"]: one for one in top["channels"]}
    assert channels["C3"]["count"] > 4
    assert channels["C3"]["per_s"] > 0
    assert not folder.exists()


def test_nothing_is_replayed_into_a_living_fleet(router: Router) -> None:
    """Nothing is said where an agent has its token, and it ends where one comes to life; both say
    who.
    """
    liveliness = router.session.liveliness()
    token = liveliness.declare_token(service_key("roco", "alive", "ta", "1"))
    words = f"replay {POUR} --system roco --connect {router.endpoint}"
    refused(router.begin(words), 1, "ta live")
    token.undeclare()
    stage = Stage("later", router.endpoint)
    stage.put("C1/co/ta/coordinate/request", b"")
    born = liveliness.declare_token(service_key("later", "alive", "ex", "1"))

    def stopped() -> bool:
        try:
            stage.put("C1/co/ta/coordinate/request", b"")
        except LivingError as error:
            return error.agents == ("ex",)
        return False

    wait_for(stopped, "it is seen")
    born.undeclare()
    stage.close()


def test_sniff_draws_what_goes_by_and_writes_it_at_the_end(router: Router) -> None:
    """Each communicate as it comes, live; Ctrl-C ends it in order, and the drawing has all of
    it.
    """
    process = router.roco("sniff --channel C2 --channel C3 --svg talk.svg")
    router.say(60)
    count, of_c3 = len(router.meant("C2", "C3")), len(router.meant("C3"))
    assert process.stdout is not None
    lines = (line.decode() for line in iter(process.stdout.readline, b""))
    assert next(lines).split() == ["co", "pl", "hi"]
    drawn = list(islice((line for line in lines if "▶" in line or "◀" in line), count))
    assert sum(" C3 " in line for line in drawn) == of_c3 > 0
    process.send_signal(signal.SIGINT)
    out, error = process.communicate(timeout=DEADLINE_S)
    assert process.returncode == 0, error.decode()
    assert f"wrote talk.svg: {count} of {count} arrows" in out.decode()
    assert (router.run / "talk.svg").read_text().count("<polygon") == count
