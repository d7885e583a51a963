"""`roco up` and `down`: the fleet brought up and down."""

import contextlib
import subprocess
from datetime import datetime
from enum import StrEnum
from pathlib import Path
from typing import Annotated

from agent_runtime.io.options import HOW_LINKED, Linking
from console import completion, interrupts
from console.errors import FleetError, UsageError
from console.fleet import starting, targets
from console.output import (
    Form,
    Format,
    Reply,
    RunDir,
    Seed,
    option,
    tell,
    tell_problem,
)
from console.runs import folders
from console.terminal.console import Console
from console.terminal.draw import Watch
from operate.doing import doing
from operate.system import here


class Speed(StrEnum):
    """1: real time, always. max: simulated time advances during acts only, as fast as it can."""

    REAL = "1"
    MAX = "max"


Rate = Annotated[Speed, option("1: real time; max: as fast as the machine can.")]
_SCENE = option("A scene's TOML file; else the system's own scene.", exists=True, dir_okay=False)
SceneFile = Annotated[Path | None, _SCENE]
Insecure = Annotated[
    bool, option("No TLS and no rights: whoever is on this host may say anything.", "--insecure")
]
_FAULTS = "Agents have wires and clocks of their own, which `roco fault` can disturb."
Faults = Annotated[bool, option(_FAULTS, "--faults")]
Out = Annotated[
    Path | None, option("Where everything is written; else runs/<time>.", "--out", "--run-dir")
]
For = Annotated[float | None, option("Bring it down after this many seconds.", "--for", min=1.0)]
_ANOTHER = "Beside a fleet that runs: a second one, in runs/NAME."
Another = Annotated[str, option(_ANOTHER, "--another", metavar="NAME")]


def up(
    out: Out = None,
    another: Another = "",
    seed: Seed = 1,
    speed: Rate = Speed.REAL,
    scene: SceneFile = None,
    only: Annotated[
        str, option("Names of processes, comma between; else all.", complete=completion.started)
    ] = "",
    insecure: Insecure = False,
    faults: Faults = False,
    links: Annotated[Linking, option(HOW_LINKED)] = Linking.DIRECT,
    agents: Annotated[
        str,
        option(
            "Where agents on other hosts, and those that they talk to, listen.",
            metavar="NAME=ENDPOINT,...",
        ),
    ] = "",
    wait: Annotated[bool, option("Come back when all are ready.")] = True,
    seconds: For = None,
    form: Form = Format.TEXT,
) -> None:
    """Bring the fleet up in the background. Ctrl-C brings down what it started.

    If a fleet runs already it starts none, unless you name a second one with --another; `--target
    NAME` then selects that one.

    Examples:
      roco up
      roco up --speed max --seed 7
      roco up --insecure --out runs/today
      roco up --only router,monitor,AGENT,PEER
      roco up --another second
      roco up --only ROUTER,PEER --agents PEER=tls/desk:7448,AGENT=tls/robot:7448
      roco up --for 30
    """
    with interrupts.heard():
        where = folders.place(out, another, datetime.now())
        words = options(seed, speed, scene, insecure, faults=faults)
        words += ["--only", only] if only else []
        words += ["--links", links.value] if links is not Linking.DIRECT else []
        words += ["--agents", agents] if agents else []
        if seconds is not None and not wait:
            raise UsageError("--for counts from when all are ready; leave --no-wait out")
        starting.check(words)
        _begun(where, words, wait, seconds, form)
        text = f"starting in {where.run}; `roco status` shows how far it is"
        if wait:
            did = "ready" if seconds is None else f"ran for {seconds:g} s"
            text = f"{did}; everything is written to {where.run}"
        if not where.latest and seconds is None:
            text += f"; `--target {another or folders.near(where.run)}` means it"
        tell(Reply(text, str(where.run)), form)


def _begun(
    where: folders.Place, words: list[str], wait: bool, seconds: float | None, form: Format
) -> None:
    """Start the fleet and wait until it is ready; let it run for some seconds then, and bring it
    down.

    What was started is brought down where that fails. FleetError: it does not come up, or its
    supervisor ends before.
    """
    with interrupts.held() as let_go:
        supervisor = starting.start(where.run, [*words, *([] if where.latest else ["--no-latest"])])
        try:
            let_go()
            if not wait:
                starting.wait_kept(where.run, supervisor)
                return
            console, quiet = Console(stderr=True), form is Format.JSON
            watch = Watch(here(), where.run, "bringing the fleet up", console, quiet)
            with watch.showing():
                look = watch.look if form is Format.TEXT else lambda _: None
                starting.wait_ready(where.run, supervisor, look)
            if seconds is None:
                return
            with (
                doing(f"the fleet runs for {seconds:g} s"),
                contextlib.suppress(subprocess.TimeoutExpired),
            ):
                code = supervisor.wait(seconds)
                raise FleetError(
                    f"the supervisor ended with code {code}; see {where.run}/supervisor.log"
                )
        except BaseException as error:
            try:
                if isinstance(error, KeyboardInterrupt) and form is Format.TEXT and seconds is None:
                    ends = "what was started is brought down, Ctrl-C does not wait"
                    tell_problem(f"interrupted; {ends}", form)
            finally:  # a closed terminal takes no words
                starting.bring_down(where.run, supervisor)
            raise
        starting.bring_down(where.run, supervisor)


def down(target: targets.Name = "", run_dir: RunDir = None, form: Form = Format.TEXT) -> None:
    """Bring the fleet down in order; works with a dead supervisor, too.

    Examples:
      roco down
      roco down --run-dir runs/today
      roco down --target compose
    """
    found = targets.find(target, run_dir)
    with doing("the fleet ends, the report is written; Ctrl-C does not wait"):
        names = found.down()
    words = f"ended {', '.join(names)}" if names else f"nothing of {found.where} was running"
    tell(Reply(words, found.where), form)


def options(
    seed: int, speed: Speed, scene: Path | None, insecure: bool, *, faults: bool = False
) -> list[str]:
    """The supervisor's options of a run."""
    words = ["--seed", str(seed), "--speed", speed.value]
    words += ["--scene", str(scene)] if scene else []
    return words + ["--insecure"] * insecure + ["--faults"] * faults
