"""Up to a thousand companions at once, simulated: true behaviours on virtual wires in one process, in virtual time.

Each companion is its six agents with search and robot scripted (tests/fleet), and is told to pour at a random moment of
one minute. A row says whether all poured, what a common router would have had to carry in its busiest second, and what
the agents' state takes in memory; and, by the design, the keys that a router has to know.

    python benchmarks/thousand.py --robots 10,100,1000
"""

import os
import random
import sys
import time
from collections import Counter
from pathlib import Path
from typing import Annotated, Any

import tables
import typer

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "tests/fleet"))

from many import memory_mb  # noqa: E402  (after the path is set)
from pretended_fleet import FINAL, Fleet  # noqa: E402

from agent_runtime.testing.wires import Faults  # noqa: E402
from companion.design import DESIGN  # noqa: E402
from companion.languages.cmd import TaskState  # noqa: E402
from fipa_codec.communicate import encode  # noqa: E402
from topdown.model.rights import Action, families, rights  # noqa: E402

WITHIN_S, LIMIT_S = 60.0, 600.0  # of virtual time: the sentences are said, all must have ended
SENTENCE = "pour the jar into the bowl"


class Companion:
    """One fleet on its wires, and what it sent in each second."""

    def __init__(self, number: int, lost: float) -> None:
        self.fleet = Fleet(seed=number, faults=Faults(loss=lost))
        self.begins = random.Random(number).uniform(0.0, WITHIN_S)
        self.began = self.fleet.wires.now
        self.sent, self.bytes = Counter[int](), Counter[int]()
        self.fleet.wires.on_step = self._count

    def _count(self, _agent: str, effects: Any) -> None:
        second = int(self.fleet.wires.now - self.began)
        self.sent[second] += len(effects.sends) + len(effects.receipts)
        self.bytes[second] += sum(len(encode(one)) for one in effects.sends)

    def go_on(self, second: int) -> bool:
        """Go on to this second of virtual time; return whether the task has ended."""
        if not self.fleet.tasks and self.begins <= second:
            self.fleet.say(SENTENCE)
        ahead = self.began + second - self.fleet.wires.now
        if ahead > 0.0:
            self.fleet.wires.run_for(ahead)
        return any(task.state in FINAL for task in self.fleet.tasks)


def measured(count: int, lost: float) -> dict[str, Any]:
    """One number of companions, as a line of the results file."""
    before, began = memory_mb(os.getpid()), time.monotonic()
    everyone = [Companion(number, lost) for number in range(count)]
    second = 0
    while sum(one.go_on(second) for one in everyone) < count and second < LIMIT_S:
        second += 1
        if second % 10 == 0:
            typer.echo(f"{second} s of virtual time, {time.monotonic() - began:.0f} s of real time")
    sent = sum((one.sent for one in everyone), Counter[int]())
    said = sum((one.bytes for one in everyone), Counter[int]())
    done = sum(task.state is TaskState.DONE for one in everyone for task in one.fleet.tasks)
    line = {
        "commit": tables.commit(), "robots": count, "lost": lost, "done": done, "virtual_s": second,
        "messages": sent.total(), "busiest_second": max(sent.values()), "busiest_kB": round(max(said.values()) / 1e3),
        "memory_MB": round(memory_mb(os.getpid()) - before, 1), "wall_s": round(time.monotonic() - began, 1),
        "keys": {name: count * number for name, number in keys().items()},
    }  # fmt: skip
    for one in everyone:
        one.fleet.close()
    return line


def keys() -> dict[str, int]:
    """Return how many keys one companion writes, and how often somebody subscribes to one or watches a token."""
    allowed = Counter(right.action for right in rights(DESIGN, "robot"))
    return {
        "keys": len(families(DESIGN, "robot")),
        "subscriptions": allowed[Action.SUBSCRIBE],
        "tokens": allowed[Action.TOKEN],
    }


def main(
    robots: Annotated[str, typer.Option(help="numbers of companions, comma between")] = "10,100,1000",
    lost: Annotated[float, typer.Option(help="share of messages that are lost on the way")] = 0.001,
    out: Annotated[Path, typer.Option(help="results file, JSON lines")] = HERE / "results/thousand.jsonl",
) -> None:
    """Measure, print and append."""
    for count in map(int, robots.split(",")):
        line = measured(count, lost)
        tables.append(out, line)
        typer.echo(f"{count} companions: {line}")


if __name__ == "__main__":
    typer.run(main)
