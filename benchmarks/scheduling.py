"""The rules of co's scheduler on random sets of tasks, beside the best that could be done with all known in advance.

A set has two to five tasks that arrive within a minute. A rule decides whenever a task arrives or ends, and knows only
what has arrived. The optimum tries every choice at the same moments, idling included, and knows all. The figure is the
cost of waiting and lateness that the rules weigh (services.coordinator.scheduling), without ageing.

    python benchmarks/scheduling.py --sets 100
"""

import math
import random
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

import msgspec
import tables
import typer
from msgspec.structs import replace

from services.coordinator.scheduling import LATE, RULES, Offer, Rule

PAGE = Path(__file__).parents[1] / "docs/scheduling.md"
BEGIN, END = "<!-- rules: python benchmarks/scheduling.py -->\n", "<!-- /rules -->\n"
WITHIN_S, MOST = 60.0, 5
REST_S, SUSPEND_S, RESUME_S = (5.0, 60.0), (2.0, 15.0), (2.0, 10.0)
"""As the robot's tasks take: a look 5 s, a pour 60 s; from rest to a jar set down and the arm retreated (measured)."""


class Scene(msgspec.Struct, frozen=True):
    """State of a schedule: the time [s], the running task, waiting tasks, tasks to come, and finished ones."""

    now: float
    running: Offer | None
    waiting: tuple[Offer, ...]
    coming: tuple[Offer, ...]
    cost: float = 0.0
    late: int = 0
    late_s: float = 0.0
    switches: int = 0


def random_set(chance: random.Random) -> Scene:
    """Return a set of tasks, in order of arrival; two in three have a deadline."""
    tasks = []
    for number in range(chance.randint(2, MOST)):
        arrived, rest = chance.uniform(0.0, WITHIN_S), chance.uniform(*REST_S)
        deadline = arrived + rest * chance.uniform(1.0, 5.0) if chance.random() < 2 / 3 else math.inf
        suspend, resume = chance.uniform(*SUSPEND_S), chance.uniform(*RESUME_S)
        tasks.append(Offer(f"task {number}", arrived, rest, deadline, suspend=suspend, resume=resume))
    return _arrivals(Scene(0.0, None, (), tuple(sorted(tasks, key=lambda one: one.arrived))))


def _arrivals(scene: Scene) -> Scene:
    """Let those wait that have arrived by now; where nothing is to be done, by the next arrival."""
    now = scene.now
    if scene.running is None and not scene.waiting and scene.coming:
        now = max(now, scene.coming[0].arrived)
    here = tuple(one for one in scene.coming if one.arrived <= now)
    return replace(scene, now=now, waiting=(*scene.waiting, *here), coming=scene.coming[len(here) :])


def chosen(scene: Scene, name: str) -> Scene:
    """Return the scene after this task was taken up, or kept, and then the next task arrived or it ended."""
    running, now = scene.running, scene.now
    if running is None or running.task != name:
        first = next(one for one in scene.waiting if one.task == name)
        waiting = tuple(one for one in scene.waiting if one.task != name)
        if running is not None:
            now += running.suspend
            waiting = (*waiting, replace(running, rest=running.rest + running.resume))
            scene = replace(scene, switches=scene.switches + 1)
        running, scene = first, replace(scene, waiting=waiting)
    ends = now + running.rest
    until = min(ends, max(now, scene.coming[0].arrived)) if scene.coming else ends
    if until == ends:
        late = max(0.0, ends - running.deadline)
        cost = scene.cost + ends - running.arrived + LATE * late
        scene = replace(scene, cost=cost, late=scene.late + (late > 0.0), late_s=scene.late_s + late)
        return _arrivals(replace(scene, now=ends, running=None))
    return _arrivals(replace(scene, now=until, running=replace(running, rest=running.rest - (until - now))))


def ruled(scene: Scene, rule: Rule) -> Scene:
    """Return how a set ends under a rule."""
    while (decision := rule(scene.running, scene.waiting, scene.now)) is not None:
        scene = chosen(scene, decision.task)
    return scene


def choices(scene: Scene) -> Iterator[Scene]:
    """Yield what could be done now: each task, and waiting for the next one."""
    running = () if scene.running is None else (scene.running,)
    for one in sorted((*running, *scene.waiting), key=lambda one: one.rest):
        yield chosen(scene, one.task)
    if scene.coming and scene.running is None:
        yield _arrivals(replace(scene, now=scene.coming[0].arrived))


def optimum(scene: Scene, best: Scene) -> Scene:
    """Return the cheapest end of a set; `best`: one that is known."""
    open_tasks = [*((scene.running,) if scene.running else ()), *scene.waiting]
    if not open_tasks and not scene.coming:
        return min(scene, best, key=lambda one: one.cost)
    at_least = sum(_least(one, max(scene.now, one.arrived)) for one in (*open_tasks, *scene.coming))
    if scene.cost + at_least >= best.cost:
        return best
    for after in choices(scene):
        best = optimum(after, best)
    return best


def _least(one: Offer, begun: float) -> float:
    """The cost of a task that goes on at once and is never left."""
    ends = begun + one.rest
    return ends - one.arrived + LATE * max(0.0, ends - one.deadline)


def main(
    sets: Annotated[int, typer.Option(min=1, help="random sets of tasks")] = 100,
    seed: Annotated[int, typer.Option()] = 1,
) -> None:
    """Write the table into docs/scheduling.md."""
    ends: dict[str, list[Scene]] = {name: [] for name in (*RULES, "optimum")}
    with typer.progressbar(range(sets), label="sets") as numbers:
        for number in numbers:
            scene = random_set(random.Random(f"{seed}-{number}"))
            known = {name: ruled(scene, rule) for name, rule in RULES.items()}
            known["optimum"] = optimum(scene, min(known.values(), key=lambda one: one.cost))
            for name, end in known.items():
                ends[name].append(end)
    tables.put(PAGE, BEGIN, printed(ends), END)


def printed(ends: dict[str, list[Scene]]) -> str:
    """Return the table: a row for each rule."""
    best = ends["optimum"]
    lines = [
        "| rule | cost, of the optimum's: mean, worst | late tasks | late, a set | switches, a set |",
        "|---|---|---|---|---|",
    ]
    for name, found in ends.items():
        ratios = [one.cost / other.cost for one, other in zip(found, best, strict=True)]
        late, late_s, switches = (sum(getattr(one, what) for one in found) for what in ("late", "late_s", "switches"))
        row = f"| {name} | {sum(ratios) / len(ratios):.2f}, {max(ratios):.2f} | {late} "
        lines.append(row + f"| {late_s / len(found):.1f} s | {switches / len(found):.2f} |")
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    typer.run(main)
