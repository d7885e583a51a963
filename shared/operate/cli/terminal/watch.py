"""A run while it goes on, for who waits: a picture that is drawn again and again, or a line for
each happening.
"""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import msgspec
from rich.console import RenderableType
from rich.live import Live

from operate.cli.fleet import starting
from operate.cli.fleet.tasks import ENDED, Task
from operate.cli.runs import folders
from operate.cli.terminal import draw, run_state
from operate.cli.terminal.console import Console
from operate.file_names import LIVE_FILE
from operate.fleet_file import Fleet, ProcessState
from operate.system import System

QUIET = (ProcessState.WAITING, ProcessState.STARTING, ProcessState.STOPPING, ProcessState.STOPPED)


class Watch:
    """Shows a system's run while it goes: a picture in a terminal, lines elsewhere; with
    `json_lines` JSON objects.
    """

    def __init__(
        self, system: System, run: Path, title: str, console: Console, json_lines: bool = False
    ) -> None:
        self.scene = draw.Scene(title, time.time(), system)
        self.run = run
        self.console = console
        self.json_lines = json_lines
        self.pictures = console.is_terminal and not json_lines
        self._follow = run_state.Follow(run_state.of_file(run / LIVE_FILE))
        self._live: Live | None = None
        self._told: dict[str, str] = {}
        if not self.pictures and not json_lines:
            console.out(f"{title}; everything is written to {folders.near(run)}", highlight=False)

    @contextmanager
    def showing(self) -> Iterator["Watch"]:
        """Show it as long as this lasts."""
        if not self.pictures:
            yield self
            return
        with Live(
            console=self.console, refresh_per_second=8, get_renderable=self._picture
        ) as self._live:
            yield self

    def ending(self) -> None:
        """Say that the rest takes some seconds more."""
        if not self.json_lines:
            self.console.print(
                "stopping the fleet, writing the report …", style="dim" if self.pictures else ""
            )

    def waits(self, words: str) -> None:
        """Say what is waited for, where it is new."""
        if self._told.get("waits") != words:
            self._told["waits"] = words
            if not self.json_lines:
                self.console.print(f"waiting {words}", style="dim" if self.pictures else "")

    def look(self, fleet_now: Fleet | None = None, tasks: tuple[Task, ...] | None = None) -> None:
        """Take in what is new: lines of the monitor, the fleet, the tasks."""
        view, system = self.scene.view, self.scene.system
        for line in self._follow.new():
            view = run_state.fold(view, line)
            self._say(line.t, run_state.in_words(line, system), line)
        self.scene = msgspec.structs.replace(
            self.scene,
            view=view,
            fleet=fleet_now or folders.fleet(self.run) or self.scene.fleet,
            tasks=self.scene.tasks if tasks is None else tasks,
            stop_held=folders.stop_held(self.run),
        )
        for status in self.scene.fleet.processes if self.scene.fleet else ():
            self._tell_once(
                status.name, starting.describe(status), status, status.state not in QUIET
            )
        for task in self.scene.tasks:
            words = (
                f"{task.said or task.task}:"
                f" {task.state}{', ' + system.plain(task.text) if task.text else ''}"
            )
            self._tell_once(f"task {task.task}", words, task, task.state in ENDED)

    def _tell_once(self, key: str, words: str, what: object, aloud: bool) -> None:
        """Say something that lasts, when it is new or changed; to people only what other lines do
        not say.
        """
        if self._told.get(key) != words:
            self._told[key] = words
            self._say(time.time(), words if aloud else "", what)

    def _say(self, t: float, words: str, what: object) -> None:
        """Write a line, where no picture is drawn."""
        if self.json_lines:
            self.console.out(msgspec.json.encode(what).decode(), highlight=False)
        elif words and not self.pictures:
            self.console.out(f"{max(0.0, t - self.scene.began):7.1f} s  {words}", highlight=False)

    def _picture(self) -> RenderableType:
        return draw.picture(self.scene, lines=self.console.height, width=self.console.width)
