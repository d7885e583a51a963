"""hi as `roco` speaks to it: for a person at a terminal, with errors that the command line
prints. And `roco page`: an address that pairs a browser with the person's page (docs/page.md).
"""

import contextlib
import hashlib
import http.client
import os
import socket
import ssl
import sys
import time
import webbrowser
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, NamedTuple, TypeVar

import msgspec
import typer

from companion import loopback
from companion.loopback import HERE, answered
from companion.run_files import (
    HI_FILE,
    PAGE_FILE,
    PAGE_KEYS,
    HiAddress,
    PageAddress,
    Pairing,
    Say,
    TaskLine,
)
from console.errors import NO, NOTHING_RUNS, ConsoleError, NoRunError
from console.fleet import targets
from console.fleet.local import Local
from console.fleet.targets import Target
from console.output import Form, Format, RunDir, problems, tell_json
from console.runs import folders
from operate import proc
from operate.file_names import LATEST
from operate.fleet_file import ProcessState

HI = "hi"
T = TypeVar("T")


class HiError(ConsoleError):
    """The human interface does not answer (status 0), or answered with another status than 200."""

    def __init__(self, status: int, reason: str) -> None:
        self.status = status
        self.reason = reason
        self.code = NO if status else NOTHING_RUNS
        super().__init__(f"the human interface said no ({status}): {reason}" if status else reason)


class Hi(loopback.Hi):
    """hi at this address; every call raises HiError."""

    error = HiError

    def say(
        self, text: str, urgency: int = 0, within_s: float = 0.0, later_s: float = 0.0
    ) -> TaskLine:
        """Say a sentence in this terminal; the task it became, or its refusal."""
        east_min = time.localtime().tm_gmtoff // 60
        return self.send(Say(text, urgency, within_s, later_s, asker=terminal(), east_min=east_min))


def terminal() -> str:
    """A name for the terminal, the same for all that is said in it: its session on this machine."""
    return f"{os.getsid(0)}@{socket.gethostname()}"[:64]


def address(fleet: Target) -> HiAddress:
    """The address of a fleet's human interface. Raise HiError if it never published one."""
    try:
        told = fleet.read(HI, HI_FILE)
        return msgspec.json.decode(told, type=HiAddress)
    except (ConsoleError, msgspec.DecodeError) as error:
        why = error if isinstance(error, ConsoleError) else f"no {HI_FILE}"
        words = f"the human interface of {fleet.where} does not listen ({why}); see `roco status`"
        raise HiError(0, words) from error


def tasks(fleet: Target) -> tuple[TaskLine, ...]:
    """The tasks of a fleet, oldest first. Raise HiError where nobody tells them."""
    return Hi(address(fleet)).tasks()


# --- Whether hi or the page, which does not listen, is on its way; waiting for it -----------------


STARTING_S = 90.0  # as long as `roco up` waits
PERIOD_S = 0.2  # estimate: nobody notices
ON_ITS_WAY = (ProcessState.WAITING, ProcessState.STARTING, ProcessState.BACKING_OFF)


class Listener(NamedTuple):
    """A process that people's tools talk to, and what Python runs."""

    name: str
    module: str


HUMAN_INTERFACE = Listener("hi", "services.human_interface")
PAGE = Listener("page", "services.page")


def when_started(
    attempt: Callable[[], T | ConsoleError], coming: Callable[[ConsoleError], bool], form: Format
) -> T:
    """What an attempt gives, made again for 90 s while it gives an error of something that is
    `coming`.

    Raise the error otherwise, NoRunError where the time is over.
    """
    until = 0.0
    while True:
        found = attempt()
        if not isinstance(found, ConsoleError):
            return found
        if not coming(found):
            raise found
        if not until:
            until = time.monotonic() + STARTING_S
            if form is Format.TEXT:
                waits = f"waiting for it, at most {STARTING_S:.0f} s"
                print(f"roco: the fleet is starting; {waits}", file=sys.stderr)
        elif time.monotonic() > until:
            words = (
                f"the fleet is still starting after {STARTING_S:.0f} s; see `roco status` ({found})"
            )
            raise NoRunError("", words) from found
        time.sleep(PERIOD_S)


def starting(wanted: Listener, name: str = "", run_dir: Path | None = None) -> bool:
    """Whether a listener of the fleet that is meant is on its way."""
    with contextlib.suppress(ConsoleError):
        look = targets.find(name, run_dir).look()
        if any(one.name == wanted.name and one.status.state in ON_ITS_WAY for one in look.seen):
            return True
        if look.fleet is not None and look.fleet.supervisor:
            return False
    return name in ("", targets.LOCAL) and begins(wanted, run_dir or folders.RUNS / LATEST)


def begins(wanted: Listener, run: Path) -> bool:
    """Whether a supervisor lives that keeps this run, or the run that is to be the latest where
    this is the latest one.

    It says so before anything of it is in a run folder. In a container the listener itself is
    looked for.
    """
    called = [words for _, words in proc.every_words()]
    if folders.around() is not None:
        return any(wanted.module in words for words in called)
    mine = {run.resolve(), run.parent.resolve()} if run.name == LATEST else {run.resolve()}
    supervisors = (
        words for words in called if {*folders.SUPERVISORS} & {*words} and "--run-dir" in words
    )
    kept = [Path(words[words.index("--run-dir") + 1]) for words in supervisors]
    return any(folder in mine or folder.parent in mine for folder in kept)


ANSWER_S = 5.0  # estimate: the page answers in milliseconds
LISTENS_S = 10.0  # estimate: it listens a second after its fleet is ready


class PageError(ConsoleError):
    """The person's page does not answer."""

    code = NOTHING_RUNS


class Door(msgspec.Struct, frozen=True):
    """An address that pairs one browser, once; for how long [s]. `tablet`: the same for a browser
    in the network, and the SHA-256 fingerprint of the certificate that it is shown; "" where the
    page is not in the network.
    """

    url: str
    within_s: float
    tablet: str = ""
    sha256: str = ""


def page(
    opened: Annotated[
        bool, typer.Option("--open", help="Open it in this machine's browser.")
    ] = False,
    target: targets.Name = "",
    run_dir: RunDir = None,
    form: Form = Format.TEXT,
) -> None:
    """Pair a browser with the person's page: print an address that does it once. It can be used for
    five minutes.

    The browser stays paired for 30 days, if the run folder exists that long. The command waits at
    most 90 s for a fleet that is starting. If the fleet was started for a tablet
    (`ROCO_PAGE=192.168.1.20:8351 roco up`), the address in the network is printed, too, with a QR
    code.

    Examples:
      roco page
      roco page --open
      roco page --target compose
    """
    with problems(form):
        found = when_started(
            lambda: _door_or_error(target, run_dir), lambda _: starting(PAGE, target, run_dir), form
        )
        if form is Format.JSON:
            tell_json(found)
        else:
            print(found.url)
            if found.tablet:
                _invite(found)
        if opened:
            webbrowser.open(found.url)


QUIET_ZONE = 4
"""Light modules around the code (ISO/IEC 18004)."""
UPPER, LOWER, BOTH = "▀▄█"


def _invite(found: Door) -> None:
    """Print where a tablet pairs, as a QR code, too, and how to know the page there."""
    print(found.tablet)
    if sys.stdout.isatty():
        from rich.style import Style  # the page's own container has no rich, and no such address
        from rich.text import Text

        from console.terminal.console import Console

        # Both colours, also where NO_COLOR is set: no terminal shows it dark for light.
        drawn = Text(qr_code(found.tablet), Style(color="#ffffff", bgcolor="#000000"))
        Console(no_color=False).print(drawn, soft_wrap=True)
    print(
        "The tablet's browser warns of a certificate that it does not know. Go on there only if it"
        f" shows this SHA-256 fingerprint:\n{found.sha256}"
    )


def qr_code(text: str) -> str:
    """A QR code in lines of half blocks: what is drawn is light, two rows of modules to a line."""
    import segno

    rows = [list(row) for row in segno.make_qr(text, error="m").matrix_iter(border=QUIET_ZONE)]
    rows += [[0] * len(rows[0])] * (len(rows) % 2)
    blocks = {(0, 0): BOTH, (0, 1): UPPER, (1, 0): LOWER, (1, 1): " "}
    lines = (
        "".join(blocks[pair] for pair in zip(above, below, strict=True))
        for above, below in zip(rows[::2], rows[1::2], strict=True)
    )
    return "\n".join(lines)


def _door_or_error(target: str, run_dir: Path | None) -> Door | ConsoleError:
    try:
        return door(targets.find(target, run_dir))
    except ConsoleError as error:
        return error


def door(fleet: Target) -> Door:
    """A new pairing address of the page of a fleet. Raise PageError where it does not answer."""
    try:
        told = fleet.read(PAGE.name, PAGE_FILE)
        if not told:
            raise PageError(f"{fleet.where} has no page (no {PAGE_FILE}); see `roco status`")
        address = msgspec.json.decode(told, type=PageAddress)
        status, data = answered(address, "POST", "/code", patience_s=ANSWER_S)
        if status != http.client.OK:
            why = data[:200].decode(errors="replace")
            raise PageError(f"the page of {fleet.where} gave no code ({status}): {why}")
        code = msgspec.json.decode(data, type=Pairing)
    except (OSError, http.client.HTTPException, msgspec.DecodeError) as error:
        raise PageError(
            f"the page of {fleet.where} does not answer ({error}); see `roco status`"
        ) from error
    except ConsoleError as error:
        if isinstance(error, PageError):
            raise
        raise PageError(f"{fleet.where} has no page ({error}); see `roco status`") from error
    url = f"http://{HERE}:{address.port}/pair#{code.code}"
    if not address.tablet:
        return Door(url, code.within_s)
    tablet = f"https://{address.tablet}/pair#{code.code}"
    return Door(url, code.within_s, tablet, _fingerprint(fleet))


def _fingerprint(fleet: Target) -> str:
    """Of the certificate that the page shows a tablet, as browsers and openssl print it."""
    pem = fleet.read(PAGE.name, f"{PAGE_KEYS}/{PAGE.name}.pem").decode("ascii", errors="replace")
    try:
        return hashlib.sha256(ssl.PEM_cert_to_DER_cert(pem)).digest().hex(":").upper()
    except ValueError as error:
        raise PageError(
            f"the page of {fleet.where} has no certificate ({error}); `roco agent restart"
            f" {PAGE.name}` makes one"
        ) from error


def door_when_there(run: Path, within_s: float = LISTENS_S) -> Door | None:
    """A new pairing address of a run, as soon as its page listens; None where it has none, or not
    in time.
    """
    fleet, told = Local(run), folders.fleet(run)
    until = time.monotonic() + within_s
    while told is not None and any(one.name == PAGE.name for one in told.processes):
        try:
            return door(fleet)
        except PageError:
            if time.monotonic() > until:
                return None
        time.sleep(PERIOD_S)
    return None
