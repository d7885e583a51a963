"""hi as `roco` speaks to it: for a person at a terminal, with errors that the command line
prints.
"""

import contextlib
import os
import socket
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple, TypeVar

import msgspec

from companion import loopback
from companion.run_files import HI_FILE, HiAddress, Say, TaskLine
from console.errors import NO, NOTHING_RUNS, ConsoleError, NoRunError
from console.fleet import targets
from console.fleet.targets import Target
from console.output import Format
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

    def __init__(self, address: HiAddress) -> None:
        super().__init__(address)

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
