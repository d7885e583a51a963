"""Address at which pictures are served: ROCO_VIEW, ROCO_VIEW_BIND, ROCO_VIEW_GRPC, ROCO_VIEW_WEB;
also in view.json.
"""

import socket
from collections.abc import Mapping
from pathlib import Path

import msgspec

from agent_runtime.io.run_files import write_whole
from operate.file_names import VIEW_FILE
from operate.fleet_file import ViewAddress

SWITCH, BIND, GRPC, WEB = "ROCO_VIEW", "ROCO_VIEW_BIND", "ROCO_VIEW_GRPC", "ROCO_VIEW_WEB"
LOOPBACK, EVERY_INTERFACE = "127.0.0.1", "0.0.0.0"


class ViewSettingError(ValueError):
    """A variable says what cannot be."""

    def __init__(self, variable: str, found: str, wanted: str) -> None:
        self.variable, self.found, self.wanted = variable, found, wanted
        super().__init__(f"{variable} is {found!r}; it may be {wanted}")


class Place(msgspec.Struct, frozen=True):
    """An interface and the ports of pictures (gRPC) and of the page (HTTP)."""

    bind: str
    grpc: int
    web: int


def wanted(environment: Mapping[str, str], number: int = 0) -> Place | None:
    """The place that the environment asks for; None: it asks for no pictures. Ports of 0 become
    free ones.

    `number`: of several systems the how-manieth: each has its own ports, the next ones. Raises
    ViewSettingError.
    """
    switch = environment.get(SWITCH) or "on"
    if switch not in ("on", "off"):
        raise ViewSettingError(SWITCH, switch, "on or off")
    if switch == "off":
        return None
    bind = environment.get(BIND) or LOOPBACK
    grpc, web = (_port(environment, name) for name in (GRPC, WEB))
    return Place(
        bind, grpc + number if grpc else free_port(bind), web + number if web else free_port(bind)
    )


def opened(bind: str, port: int) -> socket.socket:
    """A socket that listens there. Raises OSError where another program does."""
    listener = socket.socket()
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((bind, port))
        listener.listen()
    except OSError as error:
        listener.close()
        words = (
            f"no pictures: {bind}:{port} cannot be listened at: {error.strerror}; {GRPC} and {WEB}"
            " name others"
        )
        raise OSError(error.errno, words) from error
    return listener


def tell(run: Path, place: Place) -> None:
    """Write view.json, whole or not at all."""
    write_whole(run / VIEW_FILE, msgspec.json.encode(ViewAddress(place.grpc, place.web)))


def free_port(bind: str) -> int:
    """A port that nobody listens at."""
    with socket.socket() as probe:
        probe.bind((bind, 0))
        return int(probe.getsockname()[1])


def _port(environment: Mapping[str, str], name: str) -> int:
    text = environment.get(name) or "0"
    if not text.isdecimal() or int(text) > 65535:
        raise ViewSettingError(name, text, "a port, 0 for a free one")
    return int(text)
