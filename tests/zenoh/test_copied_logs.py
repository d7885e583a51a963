"""An agent whose run folder the recorder cannot read: the recorder has a copy of its log, whole,
whatever happens.
"""

import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from secured_fleet import serve
from toy_fleet import Fleet, wait_for

from agent_runtime.io import steplog
from agent_runtime.io.steplog import SENDER_LEASE_S, LogSender, read
from operate.recording import recorder
from operate.recording.recorder import CopiedLogs

AGENTS = ("co", "hi")


@pytest.fixture
def hosts(secured_router: Fleet, monkeypatch: pytest.MonkeyPatch) -> Iterator[tuple[Fleet, Fleet]]:
    """A router with keys and two agents on one host, a recorder on another."""
    monkeypatch.setenv("ROCO_VIEW", "off")
    recorder = Fleet(secured_router.run / "recorder")
    recorder.run.mkdir()
    recorder.endpoint = secured_router.endpoint
    serve(secured_router, *AGENTS)
    serve(recorder, "monitor")
    yield secured_router, recorder
    recorder.end()


def equal(agents: Fleet, recorder: Fleet) -> bool:
    """Whether each copy is what its agent has written, and not nothing."""
    pairs = [
        [fleet.run / "steps" / f"{name}.steps" for fleet in (agents, recorder)] for name in AGENTS
    ]
    return all(
        copy.exists() and copy.read_bytes() == log.read_bytes() != b"" for log, copy in pairs
    )


@pytest.mark.zenoh
@pytest.mark.timeout(200)
def test_a_copy_is_whole_though_recorder_and_agents_are_killed(hosts: tuple[Fleet, Fleet]) -> None:
    """It goes on with what was written meanwhile; each life of the agents is in the recording."""
    agents, recorder = hosts
    wait_for(lambda: equal(agents, recorder), "the logs are copied", 60.0)
    recorder.kill("monitor")
    agents.kill("co")
    serve(agents, "co")
    wait_for(lambda: len(lives(agents)) == 2, "co lives again", 60.0)
    assert not equal(agents, recorder)
    serve(recorder, "monitor")
    wait_for(lambda: equal(agents, recorder), "the logs are copied again", 60.0)
    assert lives(recorder) == [1, 2]


def lives(fleet: Fleet) -> list[int]:
    """The incarnations of co, by its log there."""
    path = fleet.run / "steps" / "co.steps"
    return [step.incarnation for step in read(path) if step.kind == "boot"] if path.exists() else []


@settings(max_examples=50, deadline=None)
@given(st.binary(min_size=1, max_size=400), st.data())
def test_whatever_is_lost_the_copy_ends_whole(log: bytes, data: st.DataObject) -> None:
    """Parts and askings are lost, the recorder begins again, the log grows; in the end nothing more
    is lost.
    """
    with tempfile.TemporaryDirectory() as folder, pytest.MonkeyPatch.context() as patch:
        now = 0.0
        patch.setattr(steplog.time, "monotonic", lambda: now)
        patch.setattr(steplog.threading, "Thread", Unstarted)
        patch.setattr(steplog, "PART_BYTES", 50)
        path, run = Path(folder) / "co.steps", Path(folder) / "run"
        path.write_bytes(log[:1])
        sent: list[bytes] = []
        sender, copies = LogSender(path, sent.append), CopiedLogs(run, "roco")
        for round_ in range(40):
            whole = round_ >= 20
            if not whole and data.draw(st.booleans()):
                copies = CopiedLogs(run, "roco")
            copies.lived("co", alive=True)
            share = 1.0 if whole else data.draw(st.floats(0.0, 1.0))
            path.write_bytes(log[: max(path.stat().st_size, round(share * len(log)))])
            now += recorder.ASK_S
            asked: list[bytes] = []
            copies.ask(lambda _, told: asked.append(told), "monitor")  # noqa: B023 - called at once
            if whole or data.draw(st.booleans()):
                for one in asked:
                    sender.wanted(one)
            _send(sender)
            for part in sent:
                if whole or data.draw(st.booleans()):
                    copies.take("co", part)
            sent.clear()
        assert (run / "steps" / "co.steps").read_bytes() == log
        now += 2 * SENDER_LEASE_S
        _send(sender)
        assert sender._thread is None, "nobody asks any more"


class Unstarted:
    """A thread that the test runs itself."""

    def __init__(self, **_: object) -> None: ...

    def start(self) -> None:
        """Do nothing."""


def _send(sender: LogSender) -> None:
    """Let it send until it would wait."""
    sender._over.wait = lambda _: sender._over.set()  # type: ignore[method-assign,assignment,func-returns-value]
    if sender._thread is not None:
        sender._send()
    sender._over.clear()


def test_a_log_that_is_here_is_not_copied(tmp_path: Path) -> None:
    """Its agent writes it."""
    (tmp_path / "steps").mkdir()
    (tmp_path / "steps" / "co.steps").write_bytes(b"local")
    copies, asked = CopiedLogs(tmp_path, "roco"), list[str]()
    copies.lived("co", alive=True)
    copies.ask(lambda key, _: asked.append(key), "monitor")
    copies.take("co", bytes(8) + b"other than what is here")
    assert asked == []
    assert (tmp_path / "steps" / "co.steps").read_bytes() == b"local"
