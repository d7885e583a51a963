"""The one command line of all services: `python -m services.<x> --help`, each option also as
ROCO_<OPTION> in the environment.

A service's `__main__.py` is `if __name__ == "__main__": cli.run("planner", "what it does", serve)`,
where `serve(options)` gives the exit status. A wrong option ends with status 2, which no supervisor
tries again.
"""

from collections.abc import Callable
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer

from agent_runtime.io.options import Options

_DEFAULT = Options()
_LISTEN = (
    "Where it listens: a router, comma between, else at --connect; an agent, else at its endpoint"
    " in --agents."
)
_SYSTEMS = "Of router and monitor: names of several robots, comma between."
_REPLAY = "Of an agent: a step log to run again offline instead of serving."
_AGENTS = "Of an agent: its endpoint and those of its neighbours, as co=tls/co:7448,ta=tls/ta:7448."


def _option(name: str, text: str) -> Any:
    return typer.Option(envvar=f"ROCO_{name}", help=text)


class Level(StrEnum):
    """Least level shown on the console."""

    DEBUG = "debug"
    INFO = "info"
    WARNING = "warning"
    ERROR = "error"


class Speed(StrEnum):
    """Speed of simulated time."""

    REAL = "1"
    MAX = "max"


def app(called: str, text: str, serve: Callable[[Options], int | None]) -> typer.Typer:
    """The command of a service."""
    command = typer.Typer(name=called, add_completion=False, pretty_exceptions_enable=False)

    @command.command(help=text)
    def main(
        connect: Annotated[str, _option("CONNECT", "The router's endpoint.")] = _DEFAULT.connect,
        listen: Annotated[str, _option("LISTEN", _LISTEN)] = _DEFAULT.listen,
        system: Annotated[
            str, _option("SYSTEM", "Prefix of every key: one name per robot.")
        ] = _DEFAULT.system,
        systems: Annotated[
            str,
            _option("SYSTEMS", _SYSTEMS),
        ] = "",
        run_dir: Annotated[
            Path, _option("RUN_DIR", "Folder of this run: journals, logs, ready files.")
        ] = _DEFAULT.run_dir,
        log_level: Annotated[
            Level, _option("LOG_LEVEL", "Least level shown; the log file has everything.")
        ] = Level.INFO,
        speed: Annotated[
            Speed, _option("SPEED", "1: real time; max: as fast as it goes.")
        ] = Speed.REAL,
        seed: Annotated[
            int, _option("SEED", "Varies poses and noise; 0: nothing.")
        ] = _DEFAULT.seed,
        scene: Annotated[
            str, _option("SCENE", "A scene's TOML file; empty: the canonical one.")
        ] = "",
        keys: Annotated[
            str, _option("TLS_DIR", "Folder of keys (`roco keys make`); empty: no encryption.")
        ] = "",
        agents: Annotated[str, _option("AGENTS", _AGENTS)] = "",
        replay: Annotated[
            str,
            _option("REPLAY", _REPLAY),
        ] = "",
    ) -> None:
        options = Options(
            connect=connect,
            listen=listen,
            system=system,
            systems=listed(systems),
            run_dir=run_dir,
            log_level=log_level.value,
            speed=speed.value,
            seed=seed,
            scene=Path(scene) if scene else None,
            keys=Path(keys) if keys else None,
            agents=endpoints(agents),
            replay=Path(replay) if replay else None,
        )
        raise typer.Exit(serve(options) or 0)

    return command


def listed(text: str) -> tuple[str, ...]:
    """The words between the commas, each once."""
    return tuple(dict.fromkeys(filter(None, (one.strip() for one in text.split(",")))))


def endpoints(text: str) -> dict[str, str]:
    """The endpoint by the name of each agent. Raises typer.BadParameter where one has none."""
    pairs = [one.partition("=") for one in listed(text)]
    wrong = ", ".join(name for name, _, endpoint in pairs if not endpoint)
    if wrong:
        raise typer.BadParameter(
            f"{wrong} has no endpoint; NAME=ENDPOINT, comma between", param_hint="--agents"
        )
    return {name: endpoint for name, _, endpoint in pairs}


def run(name: str, text: str, serve: Callable[[Options], int | None]) -> None:
    """Parse and serve; ends the process with the status of `serve`."""
    app(name, text, serve)()
