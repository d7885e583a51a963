"""Checks of the slots: what they show was measured, fits, and is never half a record."""

import mmap
import os
import time

import numpy as np

from companion.skills.loop_messages import Phase
from services.executor.conformance.judging import Measured
from services.executor.conformance.readings import copied
from services.executor.conformance.stopping import rising, turning
from services.executor.conformance.subject import Subject
from services.executor.loop.link import AgentLink

RECORDS = 4000


def shown(subject: Subject) -> Measured:
    """Return the largest difference between what the slots show after a motion and what the back-end measures."""
    with turning(subject) as (loop, heard, path):
        agent = AgentLink(path)
        agent.send(rising(loop.core))
        for _ in range(3000):
            agent.beat()
            loop.turn()
            if agent.told().report.phase is not Phase.RUNNING:
                break
        state, told = copied(heard.observe()), agent.state()
        assert told is not None
        pairs = {"q": told.q, "v": told.v, "head": told.head}
        fingers = [told.fingers(row) for row in (0, 1)]
        pairs |= {"proximal": np.array([f[0] for f in fingers]), "distal": np.array([f[1] for f in fingers])}
        off = {name: float(np.abs(state[name] - value).max()) for name, value in pairs.items()}
        off["configuration"] = float(np.abs(heard.configuration() - told.configuration).max(initial=0.0))
        off["work"] = abs(heard.work_J - told.work_J)
    where = max(off, key=lambda name: off[name])
    return off[where], f"{where}, {told.cycles} cycles"


def room(subject: Subject) -> Measured:
    """Return the size of the state's record as a share of its slot."""
    with turning(subject) as (loop, heard, path):
        loop.turn()
        slot = AgentLink(path).file.slots["state"]
        found = slot.read()
        size = len(found[1]) if found else 0
        return size / slot.capacity, f"{size} bytes, {heard.configuration().size} coordinates of the world model"


def whole(subject: Subject) -> Measured:
    """Return the number of wrong records read while another process writes as fast as possible."""
    view = memoryview(mmap.mmap(-1, 1 << 16))
    slot = subject.slot(view)
    records = [bytes([65 + k % 26]) * (1 + 7919 * k % 30000) for k in range(RECORDS)]
    child = os.fork()
    if child == 0:
        for record in records:
            slot.write(record)
        os._exit(0)
    torn, seen, until = 0, 0, time.monotonic() + 30.0
    while os.waitpid(child, os.WNOHANG) == (0, 0) and time.monotonic() < until:
        found = slot.read()
        if found is not None:
            seen += 1
            torn += found[1] != records[found[0] // 2 - 1]
    last = slot.read()
    lost = last is None or last[1] != records[-1]
    return torn + lost, f"of {seen} read while {RECORDS} were written"
