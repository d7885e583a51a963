"""Sets of run results made by hand, with known means and known faults: nothing here is measured."""

import random
from collections.abc import Callable, Collection, Iterable
from pathlib import Path

import msgspec

from companion.tools.report.measures import MEASURES, Plan, PourFigures
from operate.experiments import results
from operate.experiments.measures import Runs
from operate.experiments.run_figures import (
    RESULTS_FILE,
    SETTING_FILE,
    ExperimentSetting,
    Happened,
    Result,
    SentMessage,
)
from operate.reports.counts import Communicates, Latency, Sizes, Spans

Change = Callable[[PourFigures], PourFigures]


def same(figures: PourFigures) -> PourFigures:
    """No change."""
    return figures


def figures(seed: int, noise: random.Random) -> PourFigures:
    """One run: the seed decides what is drawn, the noise what a machine adds."""
    drawn, shake = random.Random(seed), noise.gauss(0.0, 0.02)
    answer = Spans(2, 6000.0 * (1.0 + shake), p99=10000.0, max=10200.0)
    wall = 50.0 * (1.0 + drawn.gauss(0.0, 0.05) + shake)
    return PourFigures(
        success=True,
        poured_fraction=1.0,
        sim_time_s=64.0 * (1.0 + drawn.gauss(0.0, 0.04)),
        wall_time_s=wall,
        energy_J=650.0 * (1.0 + drawn.gauss(0.0, 0.04)),
        communicates=Communicates(
            total=421,
            small=0.9,
            matrix={"pl": {"km": 116}, "km": {"pl": 116 + seed % 3}},
            per_channel={"C4": Sizes(232, 104888, least=110, mean=452.0, largest=22870)},
        ),
        plans=(
            Plan(1, 1.0, 10.0 * (1.0 + shake), 92, 184, 92534, 0.1),
            Plan(2, wall - 10, 2.1, 22, 44, 11819, 0.03),
        ),
        events=(
            Happened("command-received", 4.6, (), "command received", 3.2, ("C2",)),
            Happened("finished", 4.6 + wall, (), "finished", 67.0, ("C2",)),
        ),
        latency=(Latency("C3", "generate_plan", 15000.0, answer),),
        seed=seed,
        speed="max",
        began=1.7e9 + seed,
    )


def said(seed: int) -> tuple[SentMessage, ...]:
    """Return a run's exchanges: queries of pl with answers, and a request of co; times vary from
    run to run.
    """
    shake = random.Random(seed)
    rows, t = [], 0.0
    queries = (("pl", "km", "query-ref", "ObjectPose"), ("km", "pl", "inform-ref", "PoseOf"))
    for n in range(6):
        for sender, receiver, act, kind in queries:
            t += shake.uniform(0.01, 0.5)
            words = act, f"pl-1-{n}", kind, 150 + n, f"object pose {n}"
            rows.append(SentMessage(t, "C4", sender, receiver, "query", *words))
    for sender, receiver, act in (("co", "pl", "request"), ("pl", "co", "agree")):
        t += 0.1
        rows.append(SentMessage(t, "C3", sender, receiver, "request", act, "co-1-1", "", 90, ""))
    return tuple(rows)


def runs(
    seeds: Iterable[int] = range(1, 31),
    *,
    change: Change = same,
    failing: Collection[int] = (),
    machine: int = 1,
) -> Runs:
    """A set; `machine`: another one adds other noise. Of the failing seeds the reason is "the jar
    fell".
    """
    noise = random.Random(machine)
    found = []
    for seed in seeds:
        one = change(figures(seed, noise))
        why = "the jar fell" if seed in failing else None
        one = msgspec.structs.replace(one, success=why is None, failure=why)
        found.append(Result(seed, why, one, one.began, 60.0, False, (1.0, 2.0)))
    told = {one.seed: said(one.seed) for one in found if one.seed is not None}
    return Runs("planted", None, tuple(found), told, MEASURES)


def times(factor: float, *names: str) -> Change:
    """Multiply some figures."""
    return lambda one: msgspec.structs.replace(
        one, **{name: factor * getattr(one, name) for name in names}
    )


def written(place: Path, of: Runs, setting: ExperimentSetting | None = None) -> Path:
    """An experiment's folder with these results, as `roco experiment` leaves it, without
    recordings.
    """
    from operate.experiments import tables

    place.mkdir(parents=True)
    lines = [msgspec.json.encode(one) + b"\n" for one in of.results]
    (place / RESULTS_FILE).write_bytes(b"".join(lines))
    tables.write_said(place / results.SAID_FILE, of.said)
    if setting is not None:
        (place / SETTING_FILE).write_bytes(msgspec.json.encode(setting))
    return place
