"""`roco page`: an address that pairs a browser with the person's page (docs/page.md)."""

import http.client
import time
import webbrowser
from pathlib import Path
from typing import Annotated

import msgspec
import typer

from companion.loopback import HERE, answered
from companion.run_files import PAGE_FILE, PageAddress, Pairing
from companion.tools.verbs.hi import PAGE, PERIOD_S, starting, when_started
from console.errors import NOTHING_RUNS, ConsoleError
from console.fleet import targets
from console.fleet.local import Local
from console.fleet.targets import Target
from console.output import Form, Format, RunDir, problems, tell_json
from console.runs import folders

ANSWER_S = 5.0  # estimate: the page answers in milliseconds
STARTING_S = 10.0  # estimate: it listens a second after its fleet is ready


class PageError(ConsoleError):
    """The person's page does not answer."""

    code = NOTHING_RUNS


class Door(msgspec.Struct, frozen=True):
    """An address that pairs one browser, once; for how long [s]."""

    url: str
    within_s: float


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

    The browser stays paired as long as the run folder is there, over restarts of the page, too. A
    fleet that is starting is waited for, at most 90 s.

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
        if opened:
            webbrowser.open(found.url)


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
    return Door(f"http://{HERE}:{address.port}/pair#{code.code}", code.within_s)


def door_when_there(run: Path, within_s: float = STARTING_S) -> Door | None:
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
