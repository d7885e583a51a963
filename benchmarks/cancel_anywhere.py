"""The pouring task cancelled everywhere, in one process: what is held must be put down upright, wherever that is.

The task of pour_one_process runs once; at regular intervals of simulated time the process forks, and the child cancels
there, lets the skill make safe what it began, runs what the plan says for a cancel, and tells how the world is then.
With `--again N`, every N-th child also does the whole task again.

    python benchmarks/cancel_anywhere.py --seed 7 --every 2.0 --out runs/cancel_anywhere.jsonl
"""

import dataclasses
import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import msgspec
import tables
import typer
from pour_one_process import Run

from companion.languages import hfsm
from companion.languages.facts import Facts
from companion.sentences import operator
from companion.skills.loop_messages import Motion, Phase
from companion.skills.skill import Asked, Sensed
from services.executor.simulation import InProcess
from services.task import plan as plans

UPRIGHT_DEG = 10.0
LEAST_GAP_S = 0.1  # after the beginning of a motion


class Interruptible(InProcess):
    """A body that asks `interrupt(motion, elapsed)` now and then whether the motion is to be cancelled."""

    every_s, interrupt = 2.0, staticmethod(lambda motion, elapsed: False)

    def do(self, motion: Motion, judge: Callable[[Sensed], Asked] | None = None) -> Sensed:
        """Run a motion to its end, which is a cancelled one after a cancel, even where the two crossed."""
        began, due, cancelled = self.core.state.time, LEAST_GAP_S, False
        self.core.begin(motion)
        while self.core.report.phase is Phase.RUNNING:
            self.core.cycle()
            if judge is not None and self.core.look_due:
                self.answer(judge(self.sensed()))
            elapsed = self.core.state.time - began
            if not cancelled and elapsed >= due:
                due += self.every_s
                cancelled = self.interrupt(motion, elapsed)
                if cancelled:
                    self.core.cancel()
        sensed = self.sensed()
        return dataclasses.replace(sensed, ended="cancelled") if cancelled and sensed.ended == "done" else sensed


class Cancelled(Run):
    """A run whose children are cancelled where they were born."""

    def __init__(self, seed: int, every_s: float, only: str, out: Path, again: int) -> None:
        super().__init__(seed)
        self.out, self.only, self.again, self.children = out, only, again, 0
        self.child, self.where, self.motions = False, "", 0
        body = Interruptible(self.body.core, self.body.eye)
        body.every_s, body.interrupt = every_s, self.fork
        self.body = body
        self.plan: hfsm.HierarchicalPlan | None = None
        self.at: plans.Position = ()

    def fork(self, motion: Motion, elapsed: float) -> bool:
        """In the parent no; in a new child yes."""
        if self.child or self.plan is None or self.only not in motion.key:
            return False
        self.children += 1
        where = f"{'/'.join(self.at)} +{elapsed:.1f} s"
        pid = os.fork()
        if pid:
            os.waitpid(pid, 0)
            return False
        self.child, self.where, self.began = True, where, time.perf_counter()
        return True

    def follow(self, plan: hfsm.HierarchicalPlan) -> tuple[hfsm.Outcome, Facts]:
        """Run a plan to its end, in a child only to its cancelled act."""
        self.plan, self.at = plan, plans.first(plan.root)
        while True:
            outcome, why = self.leaf(plans.leaf(plan.root, self.at))
            if self.child:
                self.secure()
            following = plans.after(plan.root, self.at, outcome)
            if isinstance(following, hfsm.Outcome):
                self.plan = None
                return following, why
            self.at = following

    def secure(self) -> None:
        """Stand in for ta's work after the cancelled act; the child ends here."""
        line = {"where": self.where, "act": self.acts[-1][2], "held": sorted(h.object for h in self.here.held.values())}
        safe = plans.safe(self.plan.root, self.at)
        first, outcome, ended = len(self.acts), None, ""
        if safe is not None and self.here.held:
            outcome, why = super().follow(hfsm.HierarchicalPlan("safe", "safe", safe, 0.0, 0))
            ended = f"{outcome} {operator(why)}".strip()
        truth = self.truth.read()
        line |= {
            "secured": ended, "safe_acts": self.acts[first:],
            "still": sorted(h.object for h in self.here.held.values()),
            "tilt": {k: round(v, 1) for k, v in truth.tilt_deg.items()}, "on": truth.fingers_on,
            "z": {k: round(v[2], 3) for k, v in truth.at.items()},
        }  # fmt: skip
        upright = all(v < UPRIGHT_DEG for v in truth.tilt_deg.values())
        empty = not line["still"] and not any(n for on in truth.fingers_on.values() for n in on.values())
        line["good"] = upright and empty and outcome in (None, hfsm.Outcome.SUCCEEDED)
        if self.again and self.children % self.again == 0:
            self.child, self.plan, self.body.interrupt = False, None, lambda motion, elapsed: False
            line["again"] = operator(self.pour()) or "poured"
            self.child = True
        line["wall_s"] = round(time.perf_counter() - self.began, 1)
        typer.echo(f"{'good' if line['good'] else 'BAD '} {msgspec.json.encode(line).decode()}")
        tables.append(self.out, line)
        os._exit(0)


def main(
    seed: int = 7,
    every: Annotated[float, typer.Option(help="simulated seconds between cancels")] = 2.0,
    only: Annotated[str, typer.Option(help="acts whose key contains this")] = "",
    again: Annotated[int, typer.Option(help="every so many children do the task anew; 0: none")] = 0,
    out: Annotated[Path, typer.Option(help="results file, JSON lines")] = Path("cancel_anywhere.jsonl"),
) -> None:
    """Cancel a run everywhere."""
    failure = operator(Cancelled(seed, every, only, out, again).pour())
    typer.echo(f"the uncancelled run: {failure or 'poured'}")


if __name__ == "__main__":
    typer.run(main)
