"""The fleet in memory with the step logs that agents of a real one write, so that tools can read the run.

Each step has a time of its own, as with a real clock: what a step said is found by its time.
"""

from pathlib import Path
from typing import Any

from pretended_fleet import Fleet

from agent_runtime.core.effects import Effects
from agent_runtime.core.events import AnyEvent, Received
from agent_runtime.core.state import CoreState
from agent_runtime.core.step import Core
from agent_runtime.io.steplog import StepLog, noted
from companion.tools.system import SYSTEM
from operate.recording import reasons
from operate.recording.run import Run
from operate.tracing.reasons import Why

APART_S = 1e-7


class Logged:
    """Writes the steps of a fleet into a run folder; `why` reads them as `roco why` does."""

    def __init__(self, fleet: Fleet, run: Path) -> None:
        self.fleet, self.run = fleet, run
        self._logs: list[StepLog] = []
        self._steps = 0
        for name, node in fleet.wires.nodes.items():
            log = StepLog(run / "steps" / f"{name}.steps")
            self._logs.append(log)
            self._watch(node.core, log)

    def _watch(self, core: Core[Any], log: StepLog) -> None:
        """Note what a core does from now on."""
        boot, step = core.boot, core.step

        def booted(record: bytes | None) -> CoreState:
            state = boot(record)
            log.boot(state.incarnation - 1, b"" if record is None else record, self.fleet.wires.now)
            return state

        def stepped(state: CoreState, event: AnyEvent, now: float) -> tuple[CoreState, Effects]:
            self._steps += 1
            at = now + self._steps * APART_S
            after, effects = step(state, event, at)
            seen = effects.handled.communicate if isinstance(effects.handled, Received) else None
            log.write([noted(after.incarnation, after.soft.step, at, event, effects, seen)])
            return after, effects

        core.boot, core.step = booted, stepped  # type: ignore[method-assign]

    def why(self, about: str = "") -> Why:
        """The reasons of a task, or of the newest one."""
        self._flush()
        return reasons.of(Run(self.run, SYSTEM), about)

    def traced(self) -> Run:
        """The run as far as it has gone."""
        self._flush()
        return Run(self.run, SYSTEM)

    def close(self) -> None:
        """Close the logs."""
        for log in self._logs:
            log.close()

    def _flush(self) -> None:
        for log in self._logs:
            log.flush()
