"""`roco view`: Rerun's pictures of a fleet while it runs, or of a recorded run, in a window or in a
browser; or what ROS is told of a running fleet, in Foxglove (console.fleet.live_ros).

The monitor of a running fleet serves them (view.json says where); of a recorded run there is
run.rrd.
"""

import contextlib
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import webbrowser
from pathlib import Path
from typing import IO, Annotated
from urllib.parse import quote

import msgspec
import typer

from agent_runtime.io import fleet_processes
from agent_runtime.io.reaching import free_port
from console import completion, interrupts
from console.errors import ConsoleError, MissingExtraError, NoRunError, UsageError, last_line
from console.fleet import live_ros, targets
from console.fleet.local import Local
from console.fleet.status import GRPC, HOST, WEB, listens, taken
from console.output import Form, Format, RunDir, argument, option, tell_json
from console.runs import folders
from operate.file_names import RRD_FILE, VIEW_FILE
from operate.fleet_file import ViewAddress

CONTAINERS = ViewAddress(9876, 9090)
"""Ports at which deploy/compose.yaml publishes them, unless the variables above say otherwise."""
END_S = 5.0
"""Time for Rerun to end [s] (estimate: it takes a tenth)."""
PERIOD_S = 0.02
"""Period of checking whether it has ended [s]."""


class Seen(msgspec.Struct, frozen=True):
    """A picture to look at. `url`: the page in a browser ("" if none is served yet); `command`: the
    command that shows it.
    """

    what: str
    live: bool
    url: str
    command: tuple[str, ...]


def pictures(incomplete: str) -> list[str]:
    """Pictures of runs."""
    return completion.among(sorted(map(str, folders.RUNS.glob(f"*/{RRD_FILE}"))), incomplete)


def view(
    file: Annotated[
        Path | None,
        argument("Pictures in a file; else those of a run.", complete=pictures, metavar="FILE.rrd"),
    ] = None,
    web: Annotated[
        bool, option("In a browser; needs no display on this machine.", "--web")
    ] = False,
    foxglove: Annotated[
        bool, option("Serve a running fleet to Foxglove, until Ctrl-C.", "--foxglove")
    ] = False,
    ros: Annotated[bool, option("Be a node of ROS 2 over Zenoh, until Ctrl-C.", "--ros")] = False,
    at: Annotated[
        str,
        option(
            "Where --foxglove serves, else at an address that web pages cannot guess; or the router"
            " of --ros, else 127.0.0.1:7447.",
            metavar="ADDRESS:PORT",
        ),
    ] = "",
    target: targets.Name = "",
    run_dir: RunDir = None,
    form: Form = Format.TEXT,
) -> None:
    """Look at a running fleet or at a recorded run in Rerun; a running fleet also in Foxglove, or
    with ROS 2.

    With --format json it only says how, but with --foxglove or --ros it serves.

    Examples:
      roco view
      roco view --web
      roco view --run-dir runs/latest
      roco view run.rrd --web
      roco view --target compose --web --format json
      roco view --foxglove
      roco view --foxglove --at 127.0.0.1:8765
      roco view --ros
    """
    with interrupts.heard():
        if foxglove or ros:
            if file is not None or web or (foxglove and ros):
                remedy = "a recording goes there by `roco export RUN --bag FOLDER`"
                raise UsageError(f"--foxglove or --ros serve a running fleet alone; {remedy}")
            (live_ros.foxglove if foxglove else live_ros.ros)(at, target, run_dir, form)
            return
        if at:
            raise UsageError("--at is for --foxglove and --ros; for Rerun see docs/rerun.md")
        seen = found(file, target, run_dir, web)
        if form is Format.JSON:
            tell_json(seen)
        elif web and seen.live:
            page(seen.url)
        else:
            raise typer.Exit(window(seen, web))


def found(file: Path | None, target: str, run_dir: Path | None, web: bool) -> Seen:
    """Return the picture that is meant. NoRunError, UsageError, ConsoleError say what is missing
    and what to do.
    """
    if file is not None:
        if not file.is_file():
            remedy = "a run is named by --run-dir, and `roco runs` lists them"
            raise UsageError(f"{file} is no file of pictures; {remedy}")
        return recorded(file, web)
    meant = targets.find(target, run_dir)
    if not isinstance(meant, Local):
        return live(containers(os.environ), meant.where)
    run = meant.run
    address = folders.read(run / VIEW_FILE, ViewAddress)
    # another program may have it by now
    if address is not None and fleet_processes.listens(run, address.grpc):
        return live(address, meant.where)
    if (run / RRD_FILE).exists():
        return recorded(run / RRD_FILE, web)
    why = (
        "no pictures are served (its fleet has ended, or ROCO_VIEW is off; see rerun.log) and it"
        f" has no {RRD_FILE}; `roco report {run}` makes it from the recording"
    )
    for port in taken(meant, meant.look()):
        why = f"{port.words}; {port.remedy}"
        break
    raise NoRunError(str(run), f"{run} shows nothing: {why}")


def live(address: ViewAddress, where: str) -> Seen:
    """A running fleet's pictures. NoRunError where nobody serves them."""
    if not listens(address.grpc):
        at = f"nobody serves pictures of {where} at {HOST}:{address.grpc}"
        ask = f"is its port published ({GRPC}, {WEB}), is ROCO_VIEW on? See docs/rerun.md"
        raise NoRunError(where, f"{at}; {ask}")
    url = f"rerun+http://{HOST}:{address.grpc}/proxy"
    page = f"http://{HOST}:{address.web}/?url={quote(url, safe='')}"
    return Seen(where, True, page, (program(), "--connect", url))


def recorded(file: Path, web: bool) -> Seen:
    """A recorded run's pictures; in a browser they come from a server at a free port, which ends
    with the command.
    """
    if not web:
        return Seen(str(file), False, "", (program(), str(file)))
    grpc, page_port = free_port(), free_port()
    url = quote(f"rerun+http://{HOST}:{grpc}/proxy", safe="")
    ports = ("--port", str(grpc), "--web-viewer-port", str(page_port))
    command = (program(), "--serve-web", "--bind", HOST, *ports, str(file))
    return Seen(str(file), False, f"http://{HOST}:{page_port}/?url={url}", command)


def containers(environment: "os._Environ[str] | dict[str, str]") -> ViewAddress:
    """Return the address at which containers serve pictures. Raises UsageError if a variable is not
    a port.
    """
    ports = []
    for name, usual in ((GRPC, CONTAINERS.grpc), (WEB, CONTAINERS.web)):
        text = environment.get(name) or str(usual)
        if not text.isdecimal() or int(text) > 65535:
            raise UsageError(f"{name} is {text!r}; it must be a port, such as {usual}")
        ports.append(int(text))
    return ViewAddress(*ports)


def page(url: str) -> None:
    """Name the page, and open it where there is a browser."""
    print(f"open {url}")
    if has_display():
        webbrowser.open(url)


def window(seen: Seen, web: bool) -> int:
    """Run the viewer (or, for a browser, a server) until it is closed; its exit code."""
    if web:
        page(seen.url)
        print("Ctrl-C ends it")
    elif not has_display():
        raise ConsoleError(
            "there is no display here (DISPLAY, WAYLAND_DISPLAY): `roco view --web` shows the same"
            " in a browser; from another machine first `ssh -L` to both of its ports"
        )
    else:
        what = f"{seen.what}{' while it runs' if seen.live else ''}"
        print(f"Rerun shows {what}; closing its window ends nothing else")
    with tempfile.TemporaryFile() as words:
        code = shown(seen.command, words)
        if code > 0:
            words.seek(0)
            raise ConsoleError(f"the viewer ended with code {code}: {last_line(words.read())}")
    return 0


def shown(command: tuple[str, ...], words: IO[bytes]) -> int:
    """Run a viewer or a server to its end, its words into a file; its exit code. Interrupted, it
    ends it.

    Rerun's command is a Python program that runs another one: both are in a group of their own, and
    end together.
    """
    quiet = subprocess.DEVNULL
    with (
        interrupts.held() as let_go,
        subprocess.Popen(
            command, stdin=quiet, stdout=words, stderr=words, start_new_session=True
        ) as process,
    ):
        try:
            let_go()
            return process.wait()
        finally:
            _end(process)


def _end(process: "subprocess.Popen[bytes]") -> None:
    """End a process with its group, at last by SIGKILL; nothing where all have ended."""
    with contextlib.suppress(ProcessLookupError):
        for number in (signal.SIGTERM, signal.SIGKILL):
            os.killpg(process.pid, number)
            until = time.monotonic() + END_S
            while time.monotonic() < until:
                process.poll()
                os.killpg(process.pid, 0)  # ProcessLookupError: nobody of the group is left
                time.sleep(PERIOD_S)


def program() -> str:
    """Rerun's program: beside this Python, or on the path. Raise
    MissingExtraError.
    """
    beside = Path(sys.executable).with_name("rerun")
    place = str(beside) if beside.exists() else shutil.which("rerun")
    if place is None:
        raise MissingExtraError("Rerun", "monitor")
    return place


def has_display() -> bool:
    """Whether a window could be seen."""
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))
