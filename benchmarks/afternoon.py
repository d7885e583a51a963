"""Scripted commands, one fleet per seed, --speed max. `afternoon`: twelve commands with four interruptions and two
switches; `tidying`: things are put somewhere, put back, and cleared away.

Every command has a verdict by the true world: what hangs in which hand, what stands, what was poured. Nothing may be
dropped meanwhile. Appends a line per seed to a results file and skips seeds that stand there.

    python benchmarks/afternoon.py --seeds 1-10 --out benchmarks/results/afternoon.jsonl
    python benchmarks/afternoon.py --script tidying --seeds 1-3 --out benchmarks/results/tidying.jsonl
    python benchmarks/afternoon.py --table
"""

import os
import subprocess
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import msgspec
import tables
import typer
from watched_fleet import NotSeenError, WatchedFleet, held, unsafe

from companion.languages.values import Pose
from companion.models import KNOWN_AS
from operate.cli.errors import ConsoleError
from services.knowledge.relations import relate
from services.knowledge.scene import Scene, Thing
from velma.sim.truth import Truth

RESULTS = Path(__file__).parent / "results"
PAGE = Path(__file__).parents[1] / "docs/scheduling.md"
BEGIN, END = "<!-- afternoon: python benchmarks/afternoon.py --table -->\n", "<!-- /afternoon -->\n"
Verdict = Callable[[Truth], str]
CABINET = ("cabinet_2", "cabinet_2")
"""Support and container of a thing in the cabinet."""
STOOD_S, RELEASE_S = 0.5, 60.0  # [s] wall, that a stopped robot is left alone (estimate); until it can be commanded


class Command(msgspec.Struct, frozen=True):
    """A sentence, how its last task ends, and what is so then. `at`, `then`: where it is interrupted, and how.

    `then`: cancel, stop (and release), or another sentence, which is said as a more urgent one.
    """

    say: str
    verdict: Verdict
    ends: tuple[str, ...] = ("done",)
    at: str = ""
    then: str = ""


def _free(truth: Truth) -> str:
    """Everything stands upright, in no hand."""
    return unsafe(truth)


def _hangs(name: str) -> Verdict:
    return lambda truth: "" if name in held(truth) and truth.tilt_deg[name] < 20.0 else f"{name} is not held upright"


def _poured(truth: Truth) -> str:
    share = truth.grains_in["bowl_1"] / truth.grains
    return "" if share >= 0.9 else f"{100 * share:.0f} % is in the bowl"


def _any(truth: Truth) -> str:
    return ""


def _stands(name: str, *places: str) -> Verdict:
    """It stands on this, and in that, if two are named; everything is upright and in no hand."""

    def verdict(truth: Truth) -> str:
        things = {
            one: Thing(one, KNOWN_AS.get(truth.models[one], truth.models[one]), Pose(*truth.poses[one]))
            for one in truth.poses
        }
        on, inside = relate(Scene(things=things), things[name])
        return unsafe(truth) or ("" if (on, *inside) == places else f"{name} is on {on or 'nothing'}, in {inside}")

    return verdict


def _both(*verdicts: Verdict) -> Verdict:
    return lambda truth: "; ".join(filter(None, (verdict(truth) for verdict in verdicts)))


TIDY = _both(_stands("jar_1", *CABINET), _stands("bowl_1", *CABINET))
AFTERNOON = (
    Command("look around", _free),
    Command("pour the jar into the bowl", _free, ("cancelled",), "carry jar_1", "cancel"),  # interruption 1
    Command("bring me the jar", _hangs("jar_1")),
    Command("swap hands", _hangs("jar_1")),
    Command("put it down", _free),
    Command("take the bowl", _hangs("bowl_1"), ("done",), "take bowl_1", "look around"),  # switch 1
    Command("put down the bowl", _free, ("cancelled", "done"), "release", "cancel"),  # interruption 2
    Command("bring me the jar", _any, ("failed",), "take jar_1", "stop"),  # interruption 3
    Command("look around", _any),
    Command("pour the jar into the bowl", _free, ("cancelled",), "move-joint", "cancel"),  # interruption 4
    Command("pour the jar into the bowl", _poured, ("done",), "move-joint", "look around"),  # switch 2
    Command("put down the jar", _free),
)
TIDYING = (
    Command("put the bowl on the table", _stands("bowl_1", "table_1")),
    Command("put it back", TIDY),
    Command("put the jar on the table", _stands("jar_1", "table_1")),
    Command("put the jar into the cabinet", TIDY),
    Command("pour the jar into the bowl", _poured),
    Command("put the jar back", _both(_stands("jar_1", *CABINET), _poured)),
    Command("clear the table", _both(TIDY, _poured)),
    Command("clear the table", TIDY),
    Command("put the bowl on the table", _free, ("cancelled",), "take bowl_1", "cancel"),
    Command("put the jar on the table", _stands("jar_1", "table_1")),
    Command("put the jar into the cabinet", _free, ("cancelled",), "release", "cancel"),
    Command("put the jar into the cabinet", TIDY),
)
SCRIPTS = {"afternoon": AFTERNOON, "tidying": TIDYING}


def measured(script: tuple[Command, ...], seed: int, folder: Path) -> dict[str, Any]:
    """Return one run of a script, as a line of the results file."""
    line: dict[str, Any] = {"seed": seed, "load": round(os.getloadavg()[0], 1), "commands": []}
    began = time.monotonic()
    try:
        with WatchedFleet(folder, seed) as fleet:
            for command in script:
                found = _done(fleet, command)
                line["commands"].append(found)
                if found["wrong"]:
                    break
            line |= {"dropped": fleet.dropped, "sim_s": round(fleet.truth().time_s)}
    except (NotSeenError, ConsoleError, OSError, subprocess.SubprocessError) as error:
        line["failure"] = str(error)[:300]
    line["wall_s"] = round(time.monotonic() - began, 1)
    whole = len(line["commands"]) == len(script) and not any(one["wrong"] for one in line["commands"])
    return line | {"good": whole and not line.get("failure") and not line.get("dropped")}


def _done(fleet: WatchedFleet, command: Command) -> dict[str, Any]:
    """Carry out one command of the script; `wrong`: why it is not as wanted."""
    began = time.monotonic()
    task = fleet.say(command.say).task
    found: dict[str, Any] = {"say": command.say, "then": command.then}
    if command.at and fleet.reach(task, lambda line, truth: line.at is not None and command.at in line.at.path):
        found["interrupted"] = True
        found |= _interrupted(fleet, task, command.then)
    line = fleet.ended(task)
    wrong = command.verdict(fleet.truth())
    if line.state not in command.ends:
        wrong = f"{line.state}: {line.text}"
    if command.at and not found.get("interrupted"):
        wrong = f"it ended before {command.at}: {line.state}"
    wrong = wrong or found.pop("other", "")
    return found | {"state": line.state, "wrong": wrong, "wall_s": round(time.monotonic() - began, 1)}


def _interrupted(fleet: WatchedFleet, task: str, how: str) -> dict[str, Any]:
    if how == "cancel":
        fleet.hi.cancel(task)
        return {}
    if how == "stop":
        fleet.hi.stop()
        fleet.ended(task)
        time.sleep(STOOD_S)
        fleet.hi.release()
        fleet.wait(fleet.moves_again, "the release", RELEASE_S)
        return {}
    other = fleet.say(how, urgency=1).task
    line = fleet.ended(other)
    return {"other": "" if line.state == "done" else f"{how}: {line.state}: {line.text}"}


def printed() -> str:
    """Return the table of all scripts."""
    rows = ["| script | seeds | as wanted | nothing dropped | load | not as wanted |", "|---|---|---|---|---|---|"]
    for script in SCRIPTS:
        lines = tables.read(RESULTS / f"{script}.jsonl")
        loads = [line["load"] for line in lines]
        good, whole = sum(line["good"] for line in lines), sum(not line.get("dropped") for line in lines)
        wrong = "; ".join(f"seed {line['seed']}: {_wrong(line)}" for line in lines if not line["good"])
        rows.append(f"| {script} | {len(lines)} | {good} | {whole} | {min(loads):.0f} to {max(loads):.0f} | {wrong} |")
    return "\n".join(rows) + "\n"


def _wrong(line: dict[str, Any]) -> str:
    """Return the first thing that was not as wanted in a run."""
    wrong = [f"“{one['say']}”: {one['wrong']}" for one in line["commands"] if one["wrong"]]
    return str((wrong or [line.get("failure") or line.get("dropped")])[0])


def main(
    seeds: Annotated[str, typer.Option(help="first-last, or one")] = "1-10",
    out: Annotated[Path, typer.Option(help="results file, JSON lines")] = Path("afternoon.jsonl"),
    script: Annotated[str, typer.Option(help="afternoon or tidying")] = "afternoon",
    table: Annotated[bool, typer.Option("--table", help="write the table into docs/scheduling.md, and end")] = False,
) -> None:
    """Run the seeds that do not stand in the results file yet."""
    if table:
        tables.put(PAGE, BEGIN, printed(), END)
        return
    known = {line["seed"] for line in tables.read(out)}
    base = Path(tempfile.mkdtemp(prefix="afternoon-"))
    for seed in tables.seeds(seeds):
        if seed in known:
            continue
        line = measured(SCRIPTS[script], seed, base / f"seed-{seed}")
        tables.append(out, line)
        told = "good" if line["good"] else f"FAILED: {_wrong(line)}"
        typer.echo(f"seed {seed}: {told}, {len(line['commands'])} commands, {line['wall_s']} s, load {line['load']}")


if __name__ == "__main__":
    typer.run(main)
