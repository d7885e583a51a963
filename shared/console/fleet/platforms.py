"""`roco fipa`: agents of a fleet for agents of other FIPA platforms, such as JADE, as its design
has them for a guest.
"""

import asyncio
import os
import signal
import socket
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from agent_runtime.io.run_files import (
    PERIOD_S,
    RUN_FOLDER_VARIABLE,
    ProcessHeartbeat,
    listen_at,
    make_run,
    ready_file,
    write_secret,
)
from console.errors import ConsoleError, UsageError
from console.fleet import targets
from console.fleet.guests import HOST, GuestName, Visiting, Way, local, stopper, visiting
from console.fleet.local import Local
from console.fleet.process_status import Target
from console.output import Form, Format, RunDir, option, problems, tell_json
from console.runs import folders

if TYPE_CHECKING:
    from agent_runtime.io.logs import Log
    from fipa_codec.acl_string import Aid
    from operate.guests.fipa_gateway import Gateway
    from operate.guests.fipa_http import Poster, Tls

WAY = Way("FIPA", "fipa", "/acc")
NAME = WAY.verb
"""Of its journal, its log and its address in the run folder."""
PORT = 8372


def served(fleet: Target) -> str:
    """Where it is served now, for people; "" for nowhere."""
    where = WAY.served(fleet)
    return where.partition(",")[0] + ", for every program that reaches it" if where else ""


def fipa(
    at: Annotated[
        str,
        option(
            "Where it takes messages; the port may be 0. Others than loopback need --tls.",
            metavar="ADDRESS:PORT",
        ),
    ] = f"{HOST}:{PORT}",
    agreed: Annotated[
        bool,
        option(
            "You agree to every task that other platforms ask for, as long as this runs. Without"
            " it, what needs a person's consent is refused.",
            "--agreed",
        ),
    ] = False,
    df: Annotated[
        list[str] | None,
        option(
            "A directory facilitator in which our agents are registered as long as this runs.",
            "--df",
            metavar="NAME=URL",
        ),
    ] = None,
    tls: Annotated[
        Path | None,
        option(
            "A folder with certificate.pem, key.pem, authority.pem: HTTPS, and both sides show a"
            " certificate of that authority.",
            "--tls",
        ),
    ] = None,
    guest: GuestName = "",
    target: targets.Name = "",
    run_dir: RunDir = None,
    form: Form = Format.TEXT,
) -> None:
    """Let agents of other FIPA platforms, such as JADE, talk with a running fleet.

    What they may ask for stands in the design (`roco design show`); each of their messages is
    judged and recorded. It serves HTTP (SC00084) on loopback and prints its address. Conversations
    survive its end: start it again with the same run folder.

    Examples:
      roco fipa
      roco fipa --agreed --df df@lab:1099/JADE=http://127.0.0.1:7778/acc
    """
    with problems(form):
        host, port = _place(at, tls is not None)
        directories = tuple(map(_directory, df or ()))
        asyncio.run(
            _served(_fleet(target, run_dir), guest, (host, port), agreed, directories, tls, form)
        )


def _fleet(target: str, run_dir: Path | None) -> Local:
    """The fleet that is meant; in a container of its own, that of the environment."""
    folder = run_dir or Path(os.environ.get(RUN_FOLDER_VARIABLE, ""))
    if not target and folder.name and folders.around() is not None:
        make_run(folder)
    return local(target, run_dir, WAY)


def _place(at: str, guarded: bool) -> tuple[str, int]:
    from operate.guests.fipa_http import is_loopback

    try:
        host, port = listen_at(at)
        if not guarded and not is_loopback(host.strip("[]")):
            raise UsageError(f"{host} is not loopback: --tls names a folder with certificates")
    except (ValueError, OSError) as error:
        raise UsageError(f"--at {at}: {error}") from error
    return host.strip("[]"), port


def _directory(text: str) -> "Aid":
    from fipa_codec.acl_string import Aid

    name, equals, url = text.partition("=")
    if not (name and equals and url):
        raise UsageError(
            f"--df {text}: must be NAME=URL, such as df@lab:1099/JADE=http://127.0.0.1:7778/acc"
        )
    return Aid(name, (url,))


async def _served(
    fleet: Local,
    wanted: str,
    at: tuple[str, int],
    agreed: bool,
    directories: "tuple[Aid, ...]",
    keys: Path | None,
    form: Format,
) -> None:
    from operate.guests.fipa_directory import Directory
    from operate.guests.fipa_http import AddressError, HttpServer, Poster

    tls = _tls(keys)
    listening = _listener(at)
    host, port = at[0], listening.getsockname()[1]
    shown = f"[{host}]" if ":" in host else host
    url = f"{'https' if tls else 'http'}://{shown}:{port}{WAY.path}"
    poster = Poster(tls)
    try:
        for one in directories:
            await poster.usable(one.addresses)
    except AddressError as error:
        raise UsageError(f"--df: {error}") from error
    log = _log(fleet.run)
    async with visiting(fleet, WAY, wanted) as visit:
        gateway = _gateway(fleet, visit, poster, url, agreed, log)
        server = HttpServer(gateway.receive, tls)
        await server.start(listening)
        gateway.begin()
        registered = [
            Directory(one, gateway, fleet.system.design, gateway.guest, log.write)
            for one in directories
        ]
        for directory in registered:
            directory.register()
        async with _told(fleet.run, url, gateway, form):
            await _signalled()
        for directory in registered:
            await directory.deregister()
        await server.close()
        await gateway.close()
        poster.close()
    log.close()


def _gateway(
    fleet: Local, visit: Visiting, poster: "Poster", url: str, agreed: bool, log: "Log"
) -> "Gateway":
    from agent_runtime.core.errors import JournalError
    from agent_runtime.io.journal import Journal
    from operate.guests.fipa_gateway import Gateway, Rights

    stop = stopper(fleet) if folders.living(fleet.run) else _no_stop
    system = fleet.system
    try:
        journal = Journal(fleet.run / f"{NAME}.journal")
    except JournalError as error:
        raise ConsoleError(str(error)) from error
    return Gateway(
        system.design,
        system.languages,  # type: ignore[arg-type]
        Rights(visit.guest, agreed, stop),
        visit.visit,
        poster,
        journal,
        visit.name,
        url,
        log.write,
    )


def _no_stop() -> str:
    raise ConsoleError(
        "this gateway runs in a container of its own, from where the robot is not reached: call"
        " `roco stop` on the machine of the containers"
    )


@asynccontextmanager
async def _told(run: Path, url: str, gateway: "Gateway", form: Format) -> AsyncIterator[None]:
    """Tell where it is served, as long as it is; in a container also that it gets on."""
    import msgspec

    from console.fleet.guests import Address

    file, names = run / WAY.address_file, tuple(one.name for one in gateway.names.values())
    write_secret(file, msgspec.json.encode(Address(url, "")))
    beating = None
    if folders.living(run) is None:
        beating = asyncio.create_task(_beat(run))
        ready_file(run, NAME).write_text(url)
    if form is Format.JSON:
        tell_json({"url": url, "agents": names})
    else:
        print(f"{url}; agents: {', '.join(names)}", flush=True)
    try:
        yield
    finally:
        if beating is not None:
            beating.cancel()
        file.unlink(missing_ok=True)


async def _beat(run: Path) -> None:
    pulse = ProcessHeartbeat(run, NAME)
    while True:
        pulse.beat()
        await asyncio.sleep(PERIOD_S)


async def _signalled() -> None:
    ended = asyncio.Event()
    for number in (signal.SIGTERM, signal.SIGINT):
        asyncio.get_running_loop().add_signal_handler(number, ended.set)
    await ended.wait()


def _log(run: Path) -> "Log":
    import sys

    from agent_runtime.io.logs import Log

    return Log(NAME, file=run / "logs" / f"{NAME}.jsonl", console=sys.stderr)


def _tls(folder: Path | None) -> "Tls | None":
    from operate.guests.fipa_http import mutual

    if folder is None:
        return None
    try:
        return mutual(folder)
    except OSError as error:  # also ssl.SSLError
        raise UsageError(
            f"--tls {folder}: {error}; it needs certificate.pem, key.pem and authority.pem"
        ) from error


def _listener(at: tuple[str, int]) -> socket.socket:
    family = socket.AF_INET6 if ":" in at[0] else socket.AF_INET
    made = socket.socket(family)
    made.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        made.bind(at)
        made.listen()
        made.setblocking(False)
    except OSError as error:
        made.close()
        raise ConsoleError(
            f"{at[0]}:{at[1]}: {error.strerror}; --at names another place"
        ) from error
    return made
