"""The toy agents as processes that are linked: the promises of the pretend wires hold over the real ones."""

import time
from pathlib import Path

import msgspec
import pytest
import toy_agents as toy
import zenoh
from toy_fleet import DEADLINE_S, Fleet, wait_for

from agent_runtime.core.state import restored
from agent_runtime.core.step import Core
from agent_runtime.core.wiring import communicate_key
from agent_runtime.io.journal import MAGIC, frame, last_record, records
from agent_runtime.io.sessions import client_config, open_router
from agent_runtime.io.steplog import fingerprint, read, replay
from fipa_codec.communicate import Communicate, encode
from fipa_codec.performatives import Performative
from operate.supervisor.core import LATE_S

pytestmark = pytest.mark.zenoh


def journalled(run: Path, agent: str) -> object:
    """The memory in the agent's journal."""
    record = last_record((run / "journal" / f"{agent}.journal").read_bytes())
    assert record is not None
    return restored(toy.asker() if agent == "asker" else toy.server(), record).memory


def answers(run: Path) -> tuple[tuple[int, int], ...]:
    """Return the asker's answers."""
    memory = journalled(run, "asker")
    assert isinstance(memory, toy.AskerMemory)
    return memory.answers


def done(run: Path) -> tuple[int, ...]:
    """Return the server's finished work."""
    memory = journalled(run, "server")
    assert isinstance(memory, toy.ServerMemory)
    return memory.done


def expect(fleet: Fleet, *numbers: int) -> None:
    """These were asked, worked on and answered, once each and in order."""
    wait_for(lambda: len(answers(fleet.run)) >= len(numbers), f"{len(numbers)} answers\n{fleet.logs()}")
    assert answers(fleet.run) == tuple((number, 2 * number) for number in numbers)
    assert done(fleet.run) == numbers


def test_request_is_answered_and_stop_is_orderly(fleet: Fleet) -> None:
    """A request goes there and comes back; SIGTERM ends each with status 0; the step log replays to the same bytes."""
    fleet.want(4)
    expect(fleet, 4)
    assert [fleet.stop(name) for name in ("asker", "server", "router")] == [0, 0, 0]
    to_server, _ = toy.wirings()
    steps = list(replay(Core(toy.asker(), to_server), read(fleet.run / "steps" / "asker.steps")))
    assert steps
    assert all(fingerprint(effects) == step.output for step, effects in steps)


@pytest.mark.parametrize("victim", ["server", "asker"])
def test_killed_in_the_middle(fleet: Fleet, victim: str) -> None:
    """kill -9 while requests are under way, and a restart from the journal: everything happens exactly once."""
    for number in range(6):
        fleet.want(number)
    wait_for(lambda: len(answers(fleet.run)) >= 2, "some answers")
    if victim == "asker":
        # What a person said and no record holds is lost by a death, so all must be in memory first.
        wait_for(lambda: _all_wanted(fleet.run), "all words are taken")
        (fleet.run / "want").unlink()
    fleet.kill(victim)
    fleet.start(victim)
    expect(fleet, *range(6))
    fleet.ready(victim)
    assert fleet.beat(victim).incarnation == 2


def _all_wanted(run: Path) -> bool:
    record = last_record((run / "journal" / "asker.journal").read_bytes())
    return record is not None and all_are_wanted(record)


def test_a_step_without_an_end(fleet: Fleet) -> None:
    """The agent's session lives, by Zenoh's own threads, but its heartbeat stands still, which supervisors look at.

    Killed for that it is as any other that was killed.
    """
    (fleet.run / "endless").touch()
    fleet.want(1)
    beat = fleet.run / "server.heartbeat.json"
    wait_for(lambda: time.time() - beat.stat().st_mtime > 2 * LATE_S, "the heartbeat stands still")
    assert fleet.beat("asker").peers == {"server": 1}
    (fleet.run / "endless").unlink()
    fleet.kill("server")
    fleet.start("server")
    expect(fleet, 1)


@pytest.mark.parametrize("victim", ["server", "asker"])
def test_a_deleted_journal(fleet: Fleet, victim: str) -> None:
    """kill -9 with requests under way, and the journal deleted: nobody hangs, and the other side says why."""
    for number in range(6):
        fleet.want(number)
    wait_for(lambda: len(answers(fleet.run)) >= 2, "some answers")
    fleet.kill(victim)
    (fleet.run / "journal" / f"{victim}.journal").unlink()
    begins_again(fleet, victim)


@pytest.mark.parametrize("victim", ["server", "asker"])
def test_a_journal_cut(fleet: Fleet, victim: str) -> None:
    """kill -9, and the last half of the journal is lost: its peer knows more, and the agent begins again."""
    for number in range(6):
        fleet.want(number)
    wait_for(lambda: len(answers(fleet.run)) >= 3 and _all_wanted(fleet.run), "3 answers, and all words are taken")
    (fleet.run / "want").unlink()  # an asker that is started again would take them again
    fleet.kill(victim)
    journal = fleet.run / "journal" / f"{victim}.journal"
    kept = list(records(journal.read_bytes()))
    wanted = [at for at, one in enumerate(kept) if all_are_wanted(one)] if victim == "asker" else [1]
    journal.write_bytes(MAGIC + b"".join(map(frame, kept[: max(wanted[0], len(kept) // 2) + 1])))
    fleet.start(victim)
    assert fleet.processes[victim].wait(DEADLINE_S) == 1
    assert "a part of" in (fleet.run / f"{victim}.log").read_text()
    begins_again(fleet, victim)


def begins_again(fleet: Fleet, victim: str) -> None:
    """Start it: all six numbers are answered, and the other side says why its conversations ended."""
    fleet.start(victim)
    fleet.ready(victim)
    wait_for(lambda: len(answers(fleet.run)) >= 6, f"6 answers\n{fleet.logs()}")
    assert answers(fleet.run) == tuple((number, 2 * number) for number in range(6))
    other = "asker" if victim == "server" else "server"
    assert f"{victim} has another journal than before" in (fleet.run / f"{other}.log").read_text()


def all_are_wanted(record: bytes) -> bool:
    """Whether the asker has taken all six words by then."""
    memory = restored(toy.asker(), record).memory
    return len(memory.answers) + len(memory.wanted) == 6


@pytest.mark.parametrize("moved_s", [-3600, 3600])
def test_the_wall_clock_is_set(fleet: Fleet, moved_s: int) -> None:
    """By an hour, either way, while requests are under way: heartbeats, wake-ups and re-sending go on."""
    fleet.want(1)
    expect(fleet, 1)
    (fleet.run / "clock").write_text(str(moved_s))
    beat, at = fleet.run / "asker.heartbeat.json", fleet.beat("asker").at
    last = beat.stat().st_mtime_ns
    wait_for(lambda: beat.stat().st_mtime_ns > last, "the asker beats on")
    assert abs(fleet.beat("asker").at - at) < 1800
    fleet.kill("server")
    fleet.want(2)
    wait_for(lambda: fleet.beat("asker").state == "asking", "the asker asks")
    fleet.start("server")
    expect(fleet, 1, 2)


def test_router_killed(fleet: Fleet) -> None:
    """The traffic goes on, nobody is taken for dead, and the agents see that the router is away, and is back."""
    fleet.want(1)
    expect(fleet, 1)
    fleet.kill("router")
    wait_for(lambda: not fleet.beat("asker").up, "the asker sees that the router is away")
    fleet.want(2)
    expect(fleet, 1, 2)
    fleet.start("router")
    wait_for(lambda: fleet.beat("asker").up, "the asker sees the router")
    assert fleet.beat("asker").peers == {"server": 1}


def test_garbage_kills_nobody(fleet: Fleet) -> None:
    """Garbage on an agent's keys is counted, and the next request is served."""
    with zenoh.open(client_config(fleet.agents["server"])) as session:
        key = communicate_key("toy", "T1", "asker", "server", "request", Performative.REQUEST)
        lie = Communicate(
            performative=Performative.CANCEL,
            protocol="request",
            conversation="c",
            sender="asker",
            receiver="server",
            id="1",
        )
        for data in (b"", b"garbage", b"\xc1" * 100, msgspec.msgpack.encode({"V": "request"}), encode(lie)):
            session.put(key, data)
        session.put("roco/toy/_/receipt/asker/server", b"\x93garbage")
        session.put("roco/toy/_/alive/asker/many", b"")
        wait_for(lambda: fleet.beat("server").counts.get("garbled", 0) == 4, "all garbage is counted")
        wait_for(lambda: fleet.beat("server").counts.get("forged", 0) == 2, "what says other than its key, too")
    fleet.want(9)
    expect(fleet, 9)


def test_without_a_router(tmp_path: Path) -> None:
    """Agents work, say why they do not reach it, once, and stop in order."""
    fleet = Fleet(tmp_path)
    fleet.start("server", "asker")
    fleet.ready("server", "asker")
    fleet.want(1)
    expect(fleet, 1)
    wait_for(lambda: "nobody listens" in (tmp_path / "server.log").read_text(), "the agent says why")
    assert [fleet.stop(name) for name in ("asker", "server")] == [0, 0]
    assert (tmp_path / "server.log").read_text().count("no router") == 1


def test_where_its_place_is_taken_an_agent_waits(tmp_path: Path) -> None:
    """It says so, once, and still stops in order."""
    fleet = Fleet(tmp_path)
    with open_router(fleet.agents["server"]):
        fleet.start("server")
        wait_for(lambda: "cannot listen" in fleet.logs(), "it says so")
        beat = fleet.beat("server").at
        wait_for(lambda: fleet.beat("server").at > beat, "it beats on")
        assert fleet.stop("server") == 0
        assert fleet.logs().count("cannot listen") == 1


def test_a_second_process_of_an_agent_is_refused(fleet: Fleet) -> None:
    """One journal, one process: the second one ends with an error that says why, the first one serves on."""
    first = fleet.processes.pop("server")
    fleet.start("server")
    assert fleet.processes.pop("server").wait(20.0) == 1
    assert "another process holds it" in fleet.logs()
    fleet.processes["server"] = first
    fleet.want(3)
    expect(fleet, 3)
