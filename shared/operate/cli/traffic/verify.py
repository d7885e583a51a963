"""`roco replay RUN --verify`: each agent of a run is run again from its step log, and must put out the same bytes.

Each runs in a process of its own module (agent_runtime.io.step_replay), so any system's agents can. Where a step
differs, the recorded value is looked up: in the log what was done, in the journal the record, in the recording what
went by.
"""

import os
import subprocess
import sys
from datetime import datetime
from pathlib import Path

import msgspec
import typer
from rich.table import Table

from agent_runtime.io.journal import records
from agent_runtime.io.step_replay import Again, Parted, Word
from operate.cli.errors import ConsoleError, UsageError
from operate.cli.output import Form, Format, tell_json
from operate.cli.terminal.console import Console
from operate.cli.traffic.evidence import Evidence
from operate.cli.traffic.parting import Difference, Kept, first
from operate.cli.traffic.script import short
from operate.run_folder import FLEET_FILE, STEPS, TRAFFIC_FILE, Fleet
from operate.system import System, of_run

JOURNAL = "journal"
RERUN_S = 600.0
"""Of one agent; estimate: an hour's steps are run again in seconds."""


class Verified(msgspec.Struct, frozen=True):
    """An agent run again. `steps`: those that put out what they put out then; `said`: different communicates among it.

    `heard`: those of `said` that the recording has with the same bytes; None without a recording. `unlogged`: others
    that it has of the agent: the log lacks the step, as after a kill -9.
    """

    agent: str
    lives: int
    steps: int
    said: int
    heard: int | None
    unlogged: int
    difference: Difference | None


def verified(file: Path, agents: list[str], seed: int | None, form: Form) -> None:
    """Do it and tell how it went. Exits with 1 where an agent's output differs. Raises ConsoleError."""
    run, system = file if file.is_dir() else file.parent, of_run(file)
    logs = _logs(run, system, agents)
    recording = file if file.is_file() else run / TRAFFIC_FILE
    evidence = Evidence(recording if recording.is_file() else None)
    found = []
    with Console(stderr=True, quiet=form is Format.JSON).status("") as line:
        for agent, log in logs.items():
            line.update(f"{agent} runs again")
            found.append(_verified(run, _again(system, agent, log, _told(run, system, evidence, seed)), evidence))
    if form is Format.JSON:
        tell_json(found)
    else:
        _print(found)
    if any(one.difference for one in found):
        raise typer.Exit(1)


def _logs(run: Path, system: System, agents: list[str]) -> dict[str, Path]:
    """The step logs that are meant, by agent. Raises UsageError where there is none."""
    there = {path.stem: path for path in sorted((run / STEPS).glob(f"*.{STEPS}")) if path.stem in system.design.agents}
    if not there:
        raise UsageError(f"{run / STEPS} has no step logs; give the folder of a run, as `roco up` wrote it")
    for agent in agents:
        if agent not in there:
            raise UsageError(f"{run / STEPS} has no log of {agent!r}; it has {', '.join(there)}")
    return {agent: log for agent, log in there.items() if not agents or agent in agents}


def _told(run: Path, system: System, evidence: Evidence, seed: int | None) -> dict[str, str]:
    """The environment in which the agents of the run were started, as far as their steps depend on it."""
    was = evidence.setting
    told = {
        "SYSTEM": _prefix(run, system),
        "SEED": str(was.seed if seed is None else seed),
        "SPEED": was.speed,
        "SCENE": was.scene,
        "TLS_DIR": "",
        "LOG_LEVEL": "error",
    }
    return os.environ | system.environment(run) | {f"ROCO_{name}": value for name, value in told.items()}


def _prefix(run: Path, system: System) -> str:
    try:
        return msgspec.json.decode((run / FLEET_FILE).read_bytes(), type=Fleet).system
    except (OSError, msgspec.MsgspecError):
        return system.name


def _again(system: System, agent: str, log: Path, environment: dict[str, str]) -> Again:
    """An agent run again by a process of its own module. Raises ConsoleError where that fails."""
    module = next((one.module for one in system.processes if one.name == agent), "")
    if not module:
        raise UsageError(f"the system has no process {agent!r}; {', '.join(one.name for one in system.processes)} are")
    told = environment | {"ROCO_REPLAY": str(log.resolve())}
    try:
        done = subprocess.run([sys.executable, "-P", "-m", module], env=told, capture_output=True, timeout=RERUN_S)
        return msgspec.msgpack.decode(done.stdout, type=Again)
    except subprocess.TimeoutExpired as error:
        raise ConsoleError(f"{agent} has not run its steps again in {RERUN_S:.0f} s; give a shorter run") from error
    except msgspec.MsgspecError as error:
        words = done.stderr.decode(errors="replace").strip().splitlines()[-1:] or ["it says nothing"]
        raise ConsoleError(f"{agent} could not run its steps again: {words[0]}") from error


def _verified(run: Path, done: Again, evidence: Evidence) -> Verified:
    heard, said = evidence.words[done.agent], {(one.receiver, one.id): one for one in done.said}
    found: Difference | None
    if done.parted is not None:
        found = first(done.parted, _kept(run, done.agent, done.parted, evidence))
    else:
        found = next(
            (_misheard(one, heard[place]) for place, one in said.items() if _other(one, heard.get(place))), None
        )
    return Verified(
        agent=done.agent,
        lives=done.lives,
        steps=done.steps,
        said=len(said),
        heard=sum(one.digest in heard.get(place, ()) for place, one in said.items()) if evidence.there else None,
        unlogged=0 if done.parted is not None else len(heard.keys() - said.keys()),
        difference=found,
    )


def _other(one: Word, heard: set[bytes] | None) -> bool:
    """Whether only something else went by in the place of a communicate."""
    return heard is not None and one.digest not in heard


def _misheard(one: Word, heard: set[bytes]) -> Difference:
    field = f"recording of the communicate {one.id} to {one.receiver}"
    was, now = (f"digest {digest.hex()}" for digest in (min(heard), one.digest))
    return Difference(one.incarnation, one.step, one.at, one.kind, field, was, now)


def _kept(run: Path, agent: str, parted: Parted, evidence: Evidence) -> Kept:
    """Return the run's evidence about an agent's step, to tell what the step put out."""
    journal = run / JOURNAL / f"{agent}.{JOURNAL}"
    found = tuple(records(journal.read_bytes())) if journal.is_file() else ()
    return Kept(found, evidence.said(agent), evidence.receipts(agent, parted.at))


def _print(found: list[Verified]) -> None:
    drawn = Table(box=None, padding=(0, 2, 0, 0), header_style="dim")
    for name in ("agent", "lives", "steps", "said", "heard"):
        drawn.add_column(name, no_wrap=True, justify="left" if name == "agent" else "right")
    for one in found:
        heard = "-" if one.heard is None else str(one.heard)
        drawn.add_row(one.agent, str(one.lives), str(one.steps), str(one.said), heard)
    Console(highlight=False).print(drawn)
    for one in found:
        if one.unlogged:
            print(f"{one.agent}: {one.unlogged} more were heard, of steps that its log lost, as a kill -9 does")
    odd = [one for one in found if one.difference is not None]
    for one in odd:
        print(_sentence(one))
    if not odd:
        print(f"{len(found)} agents, {sum(one.steps for one in found)} steps: each put out the same bytes as then")


def _sentence(one: Verified) -> str:
    difference = one.difference
    assert difference is not None
    at = datetime.fromtimestamp(difference.at).strftime("%H:%M:%S.%f")[:-3]
    return (
        f"{one.agent} differs first in step {difference.step} of life {difference.life}, {at}, {difference.kind}\n"
        f"  in {difference.field}\n  recorded: {short(difference.recorded)}\n  now:      {short(difference.now)}"
    )
