"""Slots: one writer, many readers, nobody waits, nobody reads half a record."""

import errno
import mmap
import os

import pytest

from companion.skills.loop_messages import Cancel, Release, motion
from services.executor.loop.link import AgentLink, Counter, LoopFile, LoopLink, Slot, StopLink
from services.executor.loop.memory import _begun
from velma.errors import SlotError
from velma.names import START


@pytest.fixture
def path(tmp_path):
    return tmp_path / "run" / "loop.slots"


@pytest.fixture
def slot():
    return Slot(memoryview(mmap.mmap(-1, 4096)))


def test_the_newest_record_wins_and_numbers_grow(slot):
    """Each write is a new number, also of an empty record. One that is too large is refused, and
    the old one stays.
    """
    assert slot.read() is None
    for number, record in ((2, b""), (4, b"old")):
        assert slot.write(record) == number
        assert slot.read() == (number, record)
    with pytest.raises(SlotError, match="at most"):
        slot.write(bytes(5000))
    assert slot.read() == (4, b"old")


def test_a_writer_that_died_in_the_middle_is_seen_and_survived(slot):
    """An odd number is not a record; the next writer goes on."""
    slot.write(b"whole")
    slot._view[0] = 3
    assert slot.read() is None
    slot.write(b"again")
    assert slot.read() == (4, b"again")


def test_a_loop_finds_what_the_agent_sends_once(path):
    """Numbered, in order, the newest of what was not taken."""
    loop = LoopLink(path)
    agent = AgentLink(path)
    assert loop.command() is None
    command = motion("a", START)
    number = agent.send(command)
    assert loop.command() == (number, command)
    assert loop.command() is None
    agent.send(Cancel("a"))
    agent.beat()
    agent = AgentLink(path)  # a restarted agent goes on from the counters it finds
    agent.beat()
    last = agent.send(Release())
    assert loop.command() == (last, Release())
    assert loop.heartbeat() == 2


def test_stop_and_release_are_seen_once_each(path):
    """From a process that knows no agent."""
    loop = LoopLink(path)
    people = StopLink(path)
    people.stop()
    assert loop.people() == (True, False)
    assert loop.people() == (False, False)
    people.release()
    assert loop.people() == (False, True)


def test_the_file_is_the_owners_alone_and_its_replacement_is_noticed(path):
    """No one else may command the robot; who holds an old file can tell."""
    first = LoopLink(path)
    agent = AgentLink(path)
    assert os.stat(path).st_mode & 0o077 == 0
    assert not agent.file.replaced
    LoopLink(path)
    assert agent.file.replaced
    first.file.close()


def test_what_is_no_slot_file_is_refused(path):
    """Missing, or something else."""
    with pytest.raises(SlotError, match="start the loop first"):
        AgentLink(path)
    path.parent.mkdir()
    path.write_bytes(b"hello")
    with pytest.raises(SlotError, match="5 bytes"):
        LoopFile.open(path)


def test_a_counter_counts(slot):
    counter = Counter(slot)
    assert counter.read() == 0
    counter.add()
    counter.add()
    assert counter.read() == 2


@pytest.mark.parametrize("make", [LoopFile.create, lambda path: _begun(path, bytes(32))])
def test_a_mapped_file_is_on_the_disk_or_not_made(make, path, disk):
    """All of it: a write to a page that finds no room there would end the loop by SIGBUS."""
    path.parent.mkdir()
    make(path)
    assert path.stat().st_blocks * 512 >= path.stat().st_size > 1 << 20
    small = disk(path.parent / "small", "1m") / path.name
    with pytest.raises(OSError, match="No space left") as refused:
        make(small)
    assert refused.value.errno == errno.ENOSPC
    assert not list(small.parent.iterdir())
