"""Rerun's own server as a child process: it keeps what was logged for viewers that join late, and
serves the page.

Rerun's program listens at the given address. Where that is every interface, as in a container, its
library serves: the program has 290 MB, which the image does without. Memory is bounded, and the
server ends with the process that started it, however that ends.
"""

import ctypes
import json
import os
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import rerun as rr
import rerun_cli  # type: ignore[import-untyped]

from operate import proc
from operate.pictures.viewer_address import EVERY_INTERFACE, LOOPBACK, Place

PROGRAM = Path(rerun_cli.__file__).with_name("rerun")
KEPT = "256MiB"
"""Of what was logged, for viewers that join late; the oldest goes first. A pour needs 10 MB
(estimate: 40 of them).
"""
MOST_MB = 600
"""More memory than this ends the server: what it keeps, itself, and what it has on the way to
viewers.
"""
READY_S = 20.0
_PR_SET_PDEATHSIG = 1  # linux/prctl.h
_libc = ctypes.CDLL(None)


class ServerError(RuntimeError):
    """Rerun's server does not serve; the message says what to look at."""


class Server:
    """A running server at `place`."""

    def __init__(self, run: Path, place: Place) -> None:
        """Waits until it listens. Raises ServerError."""
        self.place = place
        self.url = f"rerun+http://{LOOPBACK}:{place.grpc}/proxy"
        self._process = subprocess.Popen(
            _command(place),
            stdin=subprocess.DEVNULL,
            env=os.environ | {"HOME": str(_home(run)), "NO_COLOR": "1"},
            preexec_fn=_die_with_parent,
        )
        self._wait(place.grpc)

    def check(self) -> None:
        """Raises ServerError where it has ended, or needs too much memory."""
        code = self._process.poll()
        if code is not None:
            raise ServerError(f"Rerun's server ended with code {code}; its words are in rerun.log")
        used = rss_mb(self._process.pid)
        if used > MOST_MB:
            raise ServerError(
                f"Rerun's server has {used:.0f} MB, at most {MOST_MB:.0f} MB: pictures start over"
            )

    def close(self) -> None:
        """End it; what it kept is gone."""
        self._process.kill()
        self._process.wait()

    def _wait(self, port: int) -> None:
        end = time.monotonic() + READY_S
        while time.monotonic() < end:
            self.check()
            with socket.socket() as probe:
                if probe.connect_ex((LOOPBACK, port)) == 0:
                    return
            time.sleep(0.05)
        raise ServerError(
            f"Rerun's server does not listen at port {port} after {READY_S:.0f} s; see rerun.log"
        )


def _command(place: Place) -> tuple[str, ...]:
    grpc, web = str(place.grpc), str(place.web)
    if place.bind == EVERY_INTERFACE:
        return sys.executable, "-P", "-m", "operate.pictures.server", grpc, web, KEPT
    options = ("--serve-web", "--bind", place.bind, "--port", grpc)
    return str(PROGRAM), *options, "--web-viewer-port", web, "--server-memory-limit", KEPT


def rss_mb(pid: int) -> float:
    """Resident memory of a process; 0 where it is gone."""
    found = proc.stats_here(pid).get(pid)
    return found.pages * proc.PAGE / 1e6 if found is not None else 0.0


def _home(run: Path) -> Path:
    """A home for the server, in which Rerun's usage statistics are switched off."""
    home = (run / "rerun-home").resolve()
    settings = home / ".config" / "rerun" / "analytics.json"
    settings.parent.mkdir(parents=True, exist_ok=True)
    places = {"config_file_path": str(settings), "data_dir_path": str(home / "analytics")}
    off = {"analytics_enabled": False, "analytics_id": "none", "metadata": {}}
    settings.write_text(json.dumps(off | places))
    return home


def _die_with_parent() -> None:
    _libc.prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)


def serve_by_library(grpc: int, web: int, kept: str) -> None:
    """Serve what is logged and the web viewer's page until a signal ends it.

    The library's server listens at every interface. It needs a recording of its own, which stays
    empty. With the name of what is drawn, the web viewer would take its own layout for ours
    (tried).
    """
    own = rr.RecordingStream("server", recording_id="server", send_properties=False)
    rr.serve_grpc(grpc_port=grpc, server_memory_limit=kept, recording=own)
    rr.serve_web_viewer(web_port=web, open_browser=False)
    while True:
        signal.pause()


if __name__ == "__main__":
    serve_by_library(int(sys.argv[1]), int(sys.argv[2]), sys.argv[3])
