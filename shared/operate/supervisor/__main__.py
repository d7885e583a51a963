"""`python -m operate.supervisor`: run a system's processes in one run folder until SIGTERM (`roco
up` does it).

What the processes share goes to them as environment variables, ROCO_<OPTION>, the same for each.
"""

import contextlib
import os
from pathlib import Path
from typing import Annotated

import msgspec
import typer

from agent_runtime.io.cli import Level, Speed, endpoints
from agent_runtime.io.fork_server import FORKS_VARIABLE
from agent_runtime.io.options import (
    AGENTS_VARIABLE,
    HOW_LINKED,
    LISTEN_VARIABLE,
    USAGE_ERROR,
    Linking,
)
from agent_runtime.io.run_files import KEYS_VARIABLE, RUN_FOLDER_VARIABLE
from agent_runtime.io.secured import ROUTER, links_file
from operate.supervisor import folder
from operate.supervisor.folder import KeptError, kept
from operate.supervisor.securing import DAYS, Keys
from operate.supervisor.shell import FORKS_FILE, Shell, end_left, forking, wired
from operate.system import NoSystemError, Process, here
from topdown.model.design import Design


def main(
    run_dir: Annotated[
        Path, typer.Option(envvar=RUN_FOLDER_VARIABLE, help="The run's folder; made where missing.")
    ],
    system: Annotated[
        str,
        typer.Option(
            envvar="ROCO_SYSTEM",
            help="Prefix of every key: one name per robot; else the system's own.",
        ),
    ] = "",
    connect: Annotated[
        str, typer.Option(envvar="ROCO_CONNECT", help="The router's address; empty: a free port.")
    ] = "",
    links: Annotated[Linking, typer.Option(help=HOW_LINKED)] = Linking.DIRECT,
    agents: Annotated[
        str,
        typer.Option(
            envvar=AGENTS_VARIABLE,
            help=(
                "Endpoints of agents, as ex=tls/robot:7448,ta=tls/desk:7448: those elsewhere and"
                " those that they talk"
                " to; others here get free ports."
            ),
        ),
    ] = "",
    speed: Annotated[
        Speed, typer.Option(envvar="ROCO_SPEED", help="1: real time; max: as fast as it goes.")
    ] = Speed.REAL,
    seed: Annotated[
        int, typer.Option(min=0, envvar="ROCO_SEED", help="Varies poses and noise; 0: nothing.")
    ] = 1,
    scene: Annotated[
        str,
        typer.Option(envvar="ROCO_SCENE", help="A scene's TOML file; empty: the canonical one."),
    ] = "",
    log_level: Annotated[
        Level,
        typer.Option(
            envvar="ROCO_LOG_LEVEL", help="Least level shown; the log files have everything."
        ),
    ] = Level.INFO,
    keys: Annotated[
        str,
        typer.Option(
            envvar=KEYS_VARIABLE,
            help="Folder of keys (`roco keys make`); empty: <run>/keys, newly made.",
        ),
    ] = "",
    insecure: Annotated[
        bool,
        typer.Option(
            "--insecure",
            help="No TLS and no rights: anyone who reaches the router may say anything.",
        ),
    ] = False,
    key_days: Annotated[
        float,
        typer.Option(
            min=1e-4, help="How long keys hold that it makes; they are renewed before they end."
        ),
    ] = DAYS,
    only: Annotated[str, typer.Option(help="Names of processes, comma between; empty: all.")] = "",
    latest: Annotated[
        bool, typer.Option(help="Let `latest` beside the run's folder point to it.")
    ] = True,
    faults: Annotated[
        bool,
        typer.Option(
            "--faults",
            help="Agents have wires and clocks of their own, which `roco fault` can disturb.",
        ),
    ] = False,
    check: Annotated[
        bool, typer.Option("--check", help="Only look at scene, seed and processes; start nothing.")
    ] = False,
) -> None:
    """Run the processes of a system: start, watch, restart, stop in order.

    Ends before anything is started with 2 and a sentence where the options do not make sense, with
    1 where another supervisor keeps the folder. What a dead one left there is ended first.
    """
    run = run_dir.resolve()
    with contextlib.ExitStack() as stack:
        try:
            bound = here()
            system = system or bound.name
            processes = chosen(only, bound.processes)
            possible = bound.addition("options")
            if possible is not None:
                possible(tuple(process.name for process in processes), scene, seed)
            routing, told = ROUTER in (process.name for process in processes), endpoints(agents)
            own = tuple(one.name for one in processes if one.name in bound.design.agents)
            given = Path(keys) if keys and not insecure else None
            away = linked_elsewhere(bound.design, own, told, given, whole=routing and not told)
            unix = links is Linking.UNIX
            if unix and (told or faults):
                raise ValueError(
                    "--links unix goes with neither --agents nor --faults: sockets are of this host"
                    " alone"
                )
            if check:
                return
            stack.enter_context(kept(run))
            end_left(run, bound.processes, system)
            folder.make(run, latest=latest)
            made = Keys(
                run,
                bound.design,
                system,
                connect,
                keys,
                insecure=insecure,
                here=routing,
                agents=dict.fromkeys((*own, *away), "") | told,
                unix=unix,
                days=key_days,
            )
        except (OSError, ValueError, NoSystemError) as error:
            typer.echo(f"supervisor: {error}", err=True)
            raise typer.Exit(USAGE_ERROR) from error
        except KeptError as error:
            typer.echo(f"supervisor: {error}", err=True)
            raise typer.Exit(1) from error
        options = {
            RUN_FOLDER_VARIABLE: str(run),
            "ROCO_SYSTEM": system,
            "ROCO_CONNECT": made.own,
            # A place of its own has one process alone: in a container its only agent.
            LISTEN_VARIABLE: os.environ.get(LISTEN_VARIABLE, "") if len(own) == 1 else "",
            AGENTS_VARIABLE: ",".join(f"{name}={at}" for name, at in made.agents.items()),
            "ROCO_SPEED": speed.value,
            "ROCO_SEED": str(seed),
            "ROCO_SCENE": str(Path(scene).resolve()) if scene else "",
            "ROCO_LOG_LEVEL": log_level.value,
            KEYS_VARIABLE: str(made.folder or ""),
            # numeric libraries would each take all cores, from the loop too
            "OMP_NUM_THREADS": "1",
            "PYTHONUNBUFFERED": "1",
            "PYTHONSAFEPATH": "1",
        }
        options |= bound.environment(run)
        apart = {ROUTER: {LISTEN_VARIABLE: made.listen}} if routing else {}
        if faults:
            processes, wires = wired(processes, bound.design, made.own, made.agents, run)
            apart |= wires
        processes = forking(processes)
        options[FORKS_VARIABLE] = str(run / FORKS_FILE)
        shell = Shell(
            run,
            processes,
            system,
            made.own,
            os.environ | options,
            tend=made.tend,
            bound=bound,
            apart=apart,
            agents=made.agents,
        )
        shell.serve()


def linked_elsewhere(
    design: Design, own: tuple[str, ...], told: dict[str, str], keys: Path | None, *, whole: bool
) -> tuple[str, ...]:
    """The neighbours of the agents that start here (`own`) whose endpoints nobody told: nobody runs
    them.

    `keys`: those that are given. `whole`: no part of the fleet is somewhere else. ValueError: `own`
    cannot be linked.
    """
    near = {peer for name in own for peer in design.peers(name)}
    away = tuple(name for name in design.agents if name in near - {*own, *told})
    if away and not whole:
        raise ValueError(
            f"{', '.join(away)} would be elsewhere; --agents tells where agents elsewhere listen"
        )
    if without := [name for name in own if keys and not links_file(keys, name).exists()]:
        lacks = f"{keys} has no rules of {', '.join(without)} for its neighbours"
        raise ValueError(f"{lacks}; `roco keys make` makes keys that have")
    return away


def chosen(only: str, processes: tuple[Process, ...]) -> tuple[Process, ...]:
    """The processes of the table with these names (comma between), each after those of them it
    waits for.

    ValueError names one that is not there.
    """
    names = [name.strip() for name in only.split(",") if name.strip()]
    unknown = set(names) - {process.name for process in processes}
    if unknown:
        there_are = ", ".join(process.name for process in processes)
        raise ValueError(
            f"no process is called {', '.join(sorted(unknown))}; there are {there_are}"
        )
    if not names:
        return processes
    wanted = []
    for process in (one for one in processes if one.name in names):
        after = tuple(name for name in process.after if name in names)
        wanted.append(msgspec.structs.replace(process, after=after))
    return tuple(wanted)


if __name__ == "__main__":
    typer.run(main)
