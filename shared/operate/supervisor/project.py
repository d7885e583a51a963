"""Runs a project made by `roco design new` in the foreground: router and agents as processes, and
what they say.

`python -m <project>` ends here. Processes are started, watched and restarted as the fleet of the
Robot Companion is.
"""

import os
import threading
import time
from datetime import datetime
from pathlib import Path
from typing import Annotated

import typer

from agent_runtime.io.options import AGENTS_VARIABLE, LISTEN_VARIABLE, Options
from agent_runtime.io.reaching import free_port
from agent_runtime.io.sessions import free_endpoint
from fipa_codec.communicate import Communicate
from fipa_codec.errors import FipaError
from operate.fleet_file import ProcessState
from operate.recording.ends import Ends
from operate.recording.records import Identity, Spoken
from operate.supervisor import folder
from operate.supervisor.folder import KeptError, kept
from operate.supervisor.shell import Shell, end_left
from operate.system import System, load
from operate.wording import escaped, one_line

PATIENCE_S = 30.0
"""Until all must be ready (estimate: an agent's start takes a second, more on a busy machine)."""


def run(entry: str) -> None:
    """The command line of a project whose system is at `entry` ("module:NAME"); ends the
    process.
    """
    system = load(entry, str(Path.cwd()))
    command = typer.Typer(name=system.name, add_completion=False, pretty_exceptions_enable=False)

    @command.command(
        help=f"Run {system.name}: its processes, printing what they say; Ctrl-C ends them."
    )
    def main(
        run_dir: Annotated[
            Path | None, typer.Option(help="The run's folder; else runs/<time>.")
        ] = None,
        connect: Annotated[
            str, typer.Option(help="The router's address; empty: a free port.")
        ] = "",
        seconds: Annotated[
            float, typer.Option(help="End after so long with all ready; 0: at Ctrl-C.")
        ] = 0.0,
        until_ready: Annotated[bool, typer.Option(help="End as soon as all are ready.")] = False,
        scene: Annotated[str, typer.Option(help="A file that the agents get as --scene.")] = "",
    ) -> None:
        where = (run_dir or Path("runs") / datetime.now().strftime("%Y-%m-%d_%H-%M-%S")).resolve()
        after_s = 0.0 if until_ready else seconds or None
        try:
            raise typer.Exit(foreground(system, where, connect or free_endpoint(), after_s, scene))
        except OSError as error:  # no loopback interface, a folder that may not be written to
            typer.echo(f"{system.name}: {error}", err=True)
            raise typer.Exit(1) from error

    command()


def foreground(
    system: System, run_dir: Path, connect: str, after_s: float | None, scene: str = ""
) -> int:
    """Run it until a signal comes, or for `after_s` once all are ready.

    0: as wanted; 1: not all became ready, or another supervisor keeps the folder.
    """
    try:
        with kept(run_dir):
            end_left(run_dir, system.processes, system.name)
            folder.make(run_dir)
            agents = {name: f"tcp/127.0.0.1:{free_port()}" for name in system.design.agents}
            environment = os.environ | {
                "ROCO_RUN_DIR": str(run_dir),
                "ROCO_SYSTEM": system.name,
                "ROCO_CONNECT": connect,
                LISTEN_VARIABLE: "",
                AGENTS_VARIABLE: ",".join(f"{name}={at}" for name, at in agents.items()),
                "ROCO_SCENE": str(Path(scene).resolve()) if scene else "",
                "PYTHONUNBUFFERED": "1",
                "PYTHONSAFEPATH": "1",
                **system.environment(run_dir),
            }
            shell = Shell(
                run_dir,
                system.processes,
                system.name,
                connect,
                environment,
                bound=system,
                agents=agents,
            )
            names = ", ".join(process.name for process in system.processes)
            here = (
                run_dir.relative_to(Path.cwd()) if run_dir.is_relative_to(Path.cwd()) else run_dir
            )
            print(f"{system.name}: {names}; files in {here}", flush=True)
            options = Options(connect=connect, system=system.name, run_dir=run_dir)
            watch = _Watch(shell, system, options, after_s)
            watch.start()
            shell.serve()
            watch.join()
            return watch.status
    except KeptError as error:
        print(error, flush=True)
        return 1


class _Watch(threading.Thread):
    """Prints what becomes of the processes and what the agents say; asks for the end when it is
    time.
    """

    def __init__(
        self, shell: Shell, system: System, options: Options, after_s: float | None
    ) -> None:
        super().__init__(daemon=True)
        self.status = 0
        self._shell, self._options, self._after_s = shell, options, after_s
        self._languages = system.languages
        self._began = time.time()
        self._ready_at: float | None = None
        self._ends = Ends(options.run_dir, system)
        self._seen: set[Identity] = set()
        self._states: dict[str, ProcessState] = {}

    def run(self) -> None:
        ended = self._shell.end_asked
        while not ended.wait(0.05):
            self._look()
            self._tell()
            if self._over():
                ended.set()
        self._tell()

    def _look(self) -> None:
        for status in self._shell.fleet.status:
            if status.state is not self._states.get(status.name):
                self._states[status.name] = status.state
                if status.state in (ProcessState.BACKING_OFF, ProcessState.GIVEN_UP):
                    self._print(f"{status.name}: {status.state}: {status.note}")
        if self._ready_at is None and self._shell.fleet.ready:
            self._ready_at = time.time()
            self._print("all ready")

    def _over(self) -> bool:
        if self._after_s is None:
            return False
        now = time.time()
        if self._ready_at is not None:
            return now - self._ready_at >= self._after_s
        if now - self._began < PATIENCE_S and ProcessState.GIVEN_UP not in self._states.values():
            return False
        late = ", ".join(
            name for name, state in self._states.items() if state is not ProcessState.READY
        )
        self._print(f"not ready: {late}; see {self._options.run_dir}/*.log")
        self.status = 1
        return True

    def _tell(self) -> None:
        """Print what was said, as the agents' logs have it."""
        for record in self._ends.new(time.time()):
            if isinstance(record, Spoken) and record.identity not in self._seen:
                self._seen.add(record.identity)
                one = record.communicate
                way = f"{one.sender} -> {one.receiver}"
                text = f"{record.channel}  {way}  {one.performative}  {self._content(one)}".rstrip()
                self._print(text, record.received)

    def _content(self, communicate: Communicate) -> str:
        try:
            content, _ = (
                self._languages.read(communicate) if self._languages is not None else (None, None)
            )
        except FipaError as error:
            return f"({error})"
        return "" if content is None else repr(content)

    def _print(self, text: str, at: float | None = None) -> None:
        print(escaped(one_line(f"{(at or time.time()) - self._began:7.2f} s  {text}")), flush=True)
