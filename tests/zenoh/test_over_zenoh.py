"""The toy agents as processes that are linked: the promises of the pretend wires hold over the real
ones.
"""

import time
from pathlib import Path
from typing import Any

import pytest
import toy_agents as toy
import zenoh
from toy_fleet import DEADLINE_S, GARBAGE, Fleet, journalled

from agent_runtime.core.step import Core
from agent_runtime.core.wiring import communicate_key
from agent_runtime.io.journal import MAGIC, frame, records
from agent_runtime.io.sessions import client_config, open_router
from agent_runtime.io.steplog import fingerprint, read, replay
from fipa_codec.communicate import Communicate, encode
from fipa_codec.performatives import Performative
from operate.supervisor.core import LATE_S

pytestmark = pytest.mark.zenoh


def answers(run: Path) -> tuple[tuple[int, int], ...]:
    """Return the asker's answers."""
    found: Any = journalled(run, toy.asker()).answers
    return tuple(found)


def done(run: Path) -> tuple[int, ...]:
    """Return the server's finished work."""
    return tuple(journalled(run, toy.server()).done)


class Expected:
    """Numbers that are asked of a fleet from now on: each is worked on and answered once, in
    order.
    """

    def __init__(self, fleet: Fleet, *numbers: int) -> None:
        self.fleet, self.numbers = fleet, numbers
        self.before = answers(fleet.run), done(fleet.run)
        fleet.want(*numbers)

    @property
    def count(self) -> int:
        """How many are answered."""
        return len(answers(self.fleet.run)) - len(self.before[0])

    def came(self) -> None:
        """Wait for all of them."""
        count = len(self.numbers)
        self.fleet.wait(lambda: self.count >= count, f"{count} answers")
        told = tuple((number, 2 * number) for number in self.numbers)
        assert answers(self.fleet.run) == (*self.before[0], *told)
        assert done(self.fleet.run) == (*self.before[1], *self.numbers)


def expect(fleet: Fleet, *numbers: int) -> None:
    """These are asked, worked on and answered."""
    Expected(fleet, *numbers).came()


def test_request_is_answered_and_stop_is_orderly(toys: Fleet) -> None:
    """A request goes there and comes back; SIGTERM ends each with status 0; the step log replays to
    the same bytes.
    """
    expect(toys, 4)
    assert [toys.stop(name) for name in ("asker", "server", "router")] == [0, 0, 0]
    to_server, _ = toy.wirings()
    steps = list(replay(Core(toy.asker(), to_server), read(toys.run / "steps" / "asker.steps")))
    assert steps
    assert all(fingerprint(effects) == step.output for step, effects in steps)


@pytest.mark.parametrize("victim", ["server", "asker"])
def test_killed_in_the_middle(shared: Fleet, victim: str) -> None:
    """kill -9 while requests are under way, and a restart from the journal: everything happens
    exactly once.
    """
    six, life = Expected(shared, *range(6)), shared.beat(victim).incarnation
    shared.wait(lambda: six.count >= 2, "some answers")
    if victim == "asker":
        # What a person said and no record holds is lost by a death, so all must be in memory first.
        shared.wait(lambda: len(asked(shared.run)) == 6 + len(six.before[0]), "all words are taken")
        (shared.run / "want").unlink()
    shared.kill(victim)
    shared.start(victim)
    six.came()
    shared.ready(victim)
    (shared.run / "want").touch()
    assert shared.beat(victim).incarnation == life + 1


def asked(run: Path, record: bytes | None = None) -> tuple[int, ...]:
    """The numbers that the asker has taken by then, answered or not."""
    memory = journalled(run, toy.asker(), record)
    return (*(number for number, _ in memory.answers), *memory.wanted)


def test_a_step_without_an_end(shared: Fleet) -> None:
    """The agent's session lives, by Zenoh's own threads, but its heartbeat stands still, which
    supervisors look at.

    Killed for that it is as any other that was killed.
    """
    peers = shared.beat("asker").peers
    (shared.run / "endless").touch()
    one, beat = Expected(shared, 1), shared.run / "server.heartbeat.json"
    still = lambda: time.time() - beat.stat().st_mtime > 2 * LATE_S  # noqa: E731
    shared.wait(still, "the heartbeat stands still")
    assert shared.beat("asker").peers == peers
    (shared.run / "endless").unlink()
    shared.kill("server")
    shared.start("server")
    one.came()


@pytest.mark.parametrize("victim", ["server", "asker"])
def test_a_deleted_journal(toys: Fleet, victim: str) -> None:
    """kill -9 with requests under way, and the journal deleted: nobody hangs, and the other side
    says why.
    """
    toys.want(*range(6))
    toys.wait(lambda: len(answers(toys.run)) >= 2, "some answers")
    toys.kill(victim)
    (toys.run / "journal" / f"{victim}.journal").unlink()
    begins_again(toys, victim)


@pytest.mark.parametrize("victim", ["server", "asker"])
def test_a_journal_cut(toys: Fleet, victim: str) -> None:
    """kill -9, and the last half of the journal is lost: its peer knows more, and the agent begins
    again.
    """
    Expected(toys, *range(6)).came()
    (toys.run / "want").unlink()  # an asker that is started again would take them again
    # What the victim forgets its peer must know: the receipt of the last answer has come.
    toys.beats_on("server")
    toys.wait(lambda: not any(toys.beat("server").unreceipted.values()), "receipts")
    toys.kill(victim)
    journal = toys.run / "journal" / f"{victim}.journal"
    kept = list(records(journal.read_bytes()))
    # What a person said must be in the part that is left: nobody says it again.
    least = next(
        at for at, one in enumerate(kept) if victim == "server" or len(asked(toys.run, one)) == 6
    )
    journal.write_bytes(MAGIC + b"".join(map(frame, kept[: max(least, len(kept) // 2) + 1])))
    toys.start(victim)
    assert toys.processes[victim].wait(DEADLINE_S) == 1
    assert "a part of" in (toys.run / f"{victim}.log").read_text()
    begins_again(toys, victim)


def begins_again(fleet: Fleet, victim: str) -> None:
    """Start it: all six numbers are answered, and the other side says why its conversations
    ended.
    """
    fleet.start(victim)
    fleet.ready(victim)
    fleet.wait(lambda: len(answers(fleet.run)) >= 6, "6 answers")
    assert answers(fleet.run) == tuple((number, 2 * number) for number in range(6))
    other = "asker" if victim == "server" else "server"
    assert f"{victim} has another journal than before" in (fleet.run / f"{other}.log").read_text()


@pytest.mark.parametrize("moved_s", [-3600, 3600])
def test_the_wall_clock_is_set(shared: Fleet, moved_s: int) -> None:
    """By an hour, either way, while requests are under way: heartbeats, wake-ups and re-sending go
    on.
    """
    expect(shared, 1)
    (shared.run / "clock").write_text(str(moved_s))
    at = shared.beat("asker").at
    shared.beats_on("asker")
    assert abs(shared.beat("asker").at - at) < 1800
    shared.kill("server")
    two = Expected(shared, 2)
    shared.wait(lambda: shared.beat("asker").state == "asking", "the asker asks")
    shared.start("server")
    two.came()
    (shared.run / "clock").unlink()


def test_router_killed(shared: Fleet) -> None:
    """The traffic goes on, nobody is taken for dead, and the agents see that the router is away,
    and is back.
    """
    expect(shared, 1)
    peers = shared.beat("asker").peers
    shared.kill("router")
    shared.wait(lambda: not shared.beat("asker").up, "the asker sees that the router is away")
    expect(shared, 2)
    shared.start("router")
    shared.wait(lambda: shared.beat("asker").up, "the asker sees the router")
    assert shared.beat("asker").peers == peers


def test_garbage_kills_nobody(shared: Fleet) -> None:
    """Garbage on an agent's keys is counted, and the next request is served."""
    with zenoh.open(client_config(shared.agents["server"])) as session:
        key = communicate_key("toy", "T1", "asker", "server", "request", Performative.REQUEST)
        lie = Communicate(
            performative=Performative.CANCEL, protocol="request", conversation="c",
            sender="asker", receiver="server", id="1",
        )  # fmt: skip
        for data in (*GARBAGE, encode(lie)):
            session.put(key, data)
        session.put("roco/toy/_/receipt/asker/server", b"\x93garbage")
        session.put("roco/toy/_/alive/asker/many", b"")
        # what says other than its key, too
        for what, count in (("garbled", 4), ("forged", 2)):
            shared.wait(
                lambda: shared.beat("server").counts.get(what, 0) == count,  # noqa: B023
                f"{what} is counted",
            )
    expect(shared, 9)


def test_a_second_process_of_an_agent_is_refused(shared: Fleet) -> None:
    """One journal, one process: the second one ends with an error that says why, the first one
    serves on.
    """
    first = shared.processes.pop("server")
    shared.start("server")
    assert shared.processes.pop("server").wait(20.0) == 1
    assert "another process holds it" in shared.logs()
    shared.processes["server"] = first
    expect(shared, 3)


def test_without_a_router(tmp_path: Path) -> None:
    """Agents work, say why they do not reach it, once, and stop in order."""
    fleet = Fleet(tmp_path)
    fleet.start("server", "asker")
    fleet.ready("server", "asker")
    expect(fleet, 1)
    fleet.wait(lambda: "nobody listens" in (tmp_path / "server.log").read_text(), "it says why")
    assert [fleet.stop(name) for name in ("asker", "server")] == [0, 0]
    assert (tmp_path / "server.log").read_text().count("no router") == 1


def test_where_its_place_is_taken_an_agent_waits(tmp_path: Path) -> None:
    """It says so, once, and still stops in order."""
    fleet = Fleet(tmp_path)
    with open_router(fleet.agents["server"]):
        fleet.start("server")
        fleet.wait(lambda: "cannot listen" in fleet.logs(), "it says so")
        fleet.beats_on("server")
        assert fleet.stop("server") == 0
        assert fleet.logs().count("cannot listen") == 1
