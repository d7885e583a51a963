"""What the verbs for programs that are guests of a design share (`roco mcp`, `roco a2a`): the
visit of a running fleet, and a server on loopback for who has its token.
"""

import asyncio
import secrets
import signal
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple
from urllib.parse import urlsplit

import msgspec

from agent_runtime.io.run_files import write_secret
from console import completion
from console.errors import ConsoleError, NoRunError, UsageError
from console.fleet import identity, targets
from console.fleet.local import Local
from console.fleet.process_status import Target
from console.fleet.status import listens
from console.output import Format, option, tell_json
from console.runs import folders

if TYPE_CHECKING:
    import socket

    from agent_runtime.io.guests import Visit

GuestName = Annotated[
    str,
    option(
        "Which guest of the design it is; else the only one.", "--as", complete=completion.guests
    ),
]
HOST = "127.0.0.1"
LEAVE_S = 2.0
"""Answers that are under way have this time when the server ends (estimate)."""


class Way(NamedTuple):
    """A way in. `protocol`: as guests of a design say how they come in; `verb`: what serves it, and
    the extra that it needs; `path`: of its address.
    """

    protocol: str
    verb: str
    path: str

    @property
    def address_file(self) -> str:
        """Of the run folder, mode 0600: an Address."""
        return f"{self.verb}.json"

    @property
    def token_file(self) -> str:
        """Of the run folder, mode 0600."""
        return f"{self.verb}.token"

    def served(self, fleet: Target) -> str:
        """Where it is served now, for people; "" for nowhere. A fleet in containers is not."""
        if not isinstance(fleet, Local):
            return ""
        try:
            address = msgspec.json.decode(fleet.read("", self.address_file), type=Address)
        except msgspec.DecodeError:
            return ""
        if not listens(urlsplit(address.url).port or 0):  # one that was killed leaves its file
            return ""
        return f"served at {address.url}, for who has the token in {self.address_file}"


class Address(msgspec.Struct, frozen=True):
    """Where a server listens, and the token that its clients show."""

    url: str
    token: str


class Visiting(NamedTuple):
    """A visit of a fleet. `name`: of the system, in its keys."""

    visit: "Visit"
    guest: str
    name: str


def local(target: str, run_dir: Path | None, way: Way) -> Local:
    """The fleet that is meant. Raise UsageError for one in containers."""
    fleet = targets.find(target, run_dir)
    if not isinstance(fleet, Local):
        raise UsageError(
            f"{fleet.where} runs in containers; `roco {way.verb}` serves a fleet of this machine"
        )
    return fleet


@asynccontextmanager
async def visiting(fleet: Local, way: Way, wanted: str) -> AsyncIterator[Visiting]:
    """Yield a visit of this guest, or of the only one that comes in so."""
    from agent_runtime.io.guests import Visit

    told = folders.living(fleet.run) or folders.around()
    if told is None:
        raise NoRunError(str(fleet.run), f"nothing runs in {fleet.run}; `roco up` starts a fleet")
    design, languages = fleet.system.design, fleet.system.languages
    known = tuple(name for name, one in design.guests.items() if way.protocol in one.by)
    guest = _guest(known, wanted, way.protocol)
    if languages is None:
        raise UsageError("the system has no languages, so nothing can be offered")
    tls = identity.tls(fleet.run, told, guest)
    try:
        visit = await asyncio.to_thread(
            Visit, design, languages, guest, told.system, told.connect, tls
        )
    except OSError as error:
        raise ConsoleError(f"{error}; is the fleet up? (`roco status`)") from error
    try:
        yield Visiting(visit, guest, told.system)
    finally:
        visit.close()


def _guest(known: tuple[str, ...], wanted: str, protocol: str) -> str:
    if wanted in known:
        return wanted
    if wanted or len(known) != 1:
        there = ", ".join(known) or f"none; a [[guest]] whose `by` has {protocol} is one"
        raise UsageError(
            f"guests of the design that come in by {protocol}: {there}; --as names one"
        )
    return known[0]


def stopper(fleet: Local) -> Callable[[], str]:
    """What stops the robot of a fleet, and says what came of it."""

    def stop() -> str:
        fleet.hold("", True)
        return "the flag of the robot is set; `roco release` lets it move again"

    return stop


async def over_http(
    way: Way, run: Path, port: int, form: Format, app: Callable[[str, str], Any]
) -> None:
    """Serve what `app` makes of address and token, until a signal ends it."""
    import uvicorn

    listening = _listener(port)
    url = f"http://{HOST}:{listening.getsockname()[1]}{way.path}"
    address = Address(url, _token(run / way.token_file))
    file = run / way.address_file
    write_secret(file, msgspec.json.encode(address))
    if form is Format.JSON:
        tell_json({"url": url, "file": str(file)})
    else:
        print(f"{url}; the token is in {file}", flush=True)
    settings = uvicorn.Config(
        app(url, address.token),
        log_config=None,
        log_level="error",
        server_header=False,
        timeout_graceful_shutdown=int(LEAVE_S),
    )
    serving = asyncio.ensure_future(uvicorn.Server(settings).serve(sockets=[listening]))
    # uvicorn ends the process by the signal it got, before what is open with the fleet is cancelled
    asyncio.get_running_loop().add_signal_handler(signal.SIGTERM, serving.cancel)
    try:
        with suppress(asyncio.CancelledError):
            await serving
    finally:
        file.unlink(missing_ok=True)


def _listener(port: int) -> "socket.socket":
    import socket

    made = socket.socket()
    made.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        made.bind((HOST, port))
        made.listen()
    except OSError as error:
        made.close()
        raise ConsoleError(f"{HOST}:{port}: {error.strerror}; --port names another one") from error
    return made


def _token(file: Path) -> str:
    """The token of this run folder: the same for each start, so that clients keep it."""
    if not file.exists():
        write_secret(file, secrets.token_urlsafe(24).encode())
    return file.read_text()
