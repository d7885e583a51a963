"""When a fault is over: by what is seen of the process that was hit, and of the one that takes its place."""

from itertools import product

import pytest

from operate.cli.faults import kinds
from operate.cli.fleet.process_status import Seen, Used
from operate.run_folder import Fault, ProcessState, ProcessStatus

PID, START = 40, 7
FAULT = Fault(id="kill-ox", kind="kill", target="ox", t=0.0, at="", pid=PID, start=START)


@pytest.mark.parametrize(
    ("state", "pid", "start"), list(product(ProcessState, (0, PID, PID + 1), (None, START, START + 1)))
)
def test_another_process_that_lives_and_is_ready_is_back(state: ProcessState, pid: int, start: int | None) -> None:
    """One that was killed is READY until its supervisor looks, and has nothing in use any more (`start` None)."""
    used = None if start is None else Used(0.0, 0, frozen=False, start=start)
    another = start is not None and (pid, start) != (PID, START)
    seen = Seen(ProcessStatus("ox", state, pid), used=used)
    assert kinds.back(seen, FAULT) == (another and state is ProcessState.READY)
