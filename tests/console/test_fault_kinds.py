"""When a fault is over: by what is seen of the process that was hit, and of the one that takes its
place.
"""

import signal
from itertools import product

import msgspec

from console.faults import kinds
from console.fleet.process_status import Look, Seen
from operate.fault_lines import Fault
from operate.fleet_file import ProcessState, ProcessStatus
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
