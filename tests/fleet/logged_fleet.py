"""The fleet in memory with the step logs that agents of a real one write, so that tools can read
the run.

Each step has a time of its own, as with a real clock: what a step said is found by its time.
"""

from pretended_fleet import Fleet

from agent_runtime.core.events import Received
from agent_runtime.io.steplog import StepLog, noted
from companion.tools.system import SYSTEM
from operate.recording.run import Run, reasons

APART_S = 1e-7


class LoggedFleet(Fleet):
    """Writes its steps into a run folder; `why` and `traced` read them as `roco why` and `roco
    trace` do.
    """

    def __init__(self, run):
        super().__init__()
        self.run = run
        self.logs = {name: StepLog(run / "steps" / f"{name}.steps") for name in self.wires.nodes}
        self._count = 0
        for name, node in self.wires.nodes.items():
            self._log(node.core, self.logs[name])

    def _log(self, core, log):
        boot, step = core.boot, core.step

        def booted(record):
            state = boot(record)
            log.boot(state.incarnation - 1, b"" if record is None else record, self.wires.now)
            return state

        def stepped(state, event, now):
            self._count += 1
            at = now + self._count * APART_S
            after, effects = step(state, event, at)
            seen = effects.handled.communicate if isinstance(effects.handled, Received) else None
            log.write([noted(after.incarnation, after.soft.step, at, event, effects, seen)])
            return after, effects

        core.boot, core.step = booted, stepped  # type: ignore[method-assign]

    def __exit__(self, kind, *more):
        for log in self.logs.values():
            log.close()
        super().__exit__(kind, *more)

    def reasons(self, about=""):
        """The reasons of a task, or of the newest one."""
        self.flush()
        return reasons(Run(self.run, SYSTEM), about)

    def traced(self):
        """The run as far as it has gone."""
        self.flush()
        return Run(self.run, SYSTEM)

    def flush(self):
        """Write what was logged so far."""
        for log in self.logs.values():
            log.flush()
