"""`roco fault run FILE --seed N`: a scenario, each fault of it a `roco fault` of its own, so that
each heals itself.
"""

import contextlib
import math
import random
import signal
import subprocess
import sys
import time
import tomllib
from pathlib import Path
from typing import Annotated

import msgspec

from console import interrupts
from console.errors import FleetError, UsageError
from console.faults import inflict, moments
from console.faults.kinds import AMOUNTS, KINDS, UNTIMED, VERBS
from console.faults.verbs import heal_left
from console.fleet import targets
from console.fleet.targets import named
from console.output import Form, Format, RunDir, argument, option, problems

# --- A scenario: faults in a TOML file, of which a seed chooses what the file leaves open. Pure but
# for `load`
# [[fault]]
# kind = "delay"            # a verb of `roco fault`
# target = ["mule", "ox"]   # one of them
# at = [0.0, 5.0]           # some time between; or as --at has it
# for = 2.0                 # a number, or [least, most], as amount
# amount = [0.05, 0.2]


SIGNED = tuple(
    name for name, kind in KINDS.items() if kind.amount is not None and kind.amount.tried[0] < 0
)
"""Kinds whose amount may be below 0."""
Span = float | tuple[float, float]


class Entry(msgspec.Struct, frozen=True, forbid_unknown_fields=True, rename={"for_": "for"}):
    """One [[fault]] as it is written."""

    kind: str
    target: str | tuple[str, ...]
    at: str | Span = ""
    for_: Span | None = None
    amount: Span | None = None
    within: float | None = None


class Scenario(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A file. `text`: what it is for, in words."""

    fault: tuple[Entry, ...]
    text: str = ""


class Chosen(msgspec.Struct, frozen=True):
    """A fault with nothing left open. `at`: as --at has it, or seconds after the scenario's begin;
    None: not given.
    """

    kind: str
    target: str
    at: str | float
    for_: float | None
    amount: float | None
    within: float | None


def load(file: Path) -> Scenario:
    """Read a scenario. Raise UsageError with the file and the field that is wrong."""
    try:
        scenario = msgspec.convert(tomllib.loads(file.read_text(encoding="utf-8-sig")), Scenario)
    # the last two from tomllib; msgspec's is a ValueError
    except (OSError, ValueError, RecursionError) as error:
        raise UsageError(f"{file}: {error}; docs/faults.md shows a scenario") from error
    if not scenario.fault:
        raise UsageError(f"{file}: it has no [[fault]]; docs/faults.md shows one")
    for number, entry in enumerate(scenario.fault, 1):
        if why := _wrong(entry):
            raise UsageError(f"{file}: fault {number}: {why}")
    return scenario


def _wrong(entry: Entry) -> str:
    """Return what is wrong with an entry; "" where nothing is."""
    if entry.kind not in VERBS:
        return f"there is no kind {entry.kind!r}; there are {', '.join(VERBS)}"
    if not entry.target:
        return "target names no process"
    if entry.amount is None and entry.kind in AMOUNTS:
        return f"{entry.kind} needs an amount"
    if entry.amount is not None and KINDS[entry.kind].amount is None:
        return f"{entry.kind} has no amount"
    if entry.for_ is not None and entry.kind in UNTIMED:
        return f"{entry.kind} has no `for`: it is over when the process is back"
    spans = {"at": entry.at, "for": entry.for_, "amount": entry.amount, "within": entry.within}
    for name, span in spans.items():
        least = -math.inf if entry.kind in SIGNED and name == "amount" else 0.0
        if isinstance(span, tuple) and not least <= span[0] <= span[1] < math.inf:
            given = f"{name} = [{span[0]:g}, {span[1]:g}]"
            return f"{given} is no span: give [least, most], neither below {least:g}"
        if isinstance(span, float) and not least <= span < math.inf:
            return f"{name} = {span:g} is below 0 or no number"
    return ""


def choose(scenario: Scenario, seed: int) -> tuple[Chosen, ...]:
    """Return the faults of a scenario, the same for the same seed."""
    chance = random.Random(seed)

    def within(span: Span | None) -> float | None:
        return round(chance.uniform(*span), 3) if isinstance(span, tuple) else span

    found = []
    for one in scenario.fault:
        target = one.target if isinstance(one.target, str) else chance.choice(one.target)
        at = one.at if isinstance(one.at, str) else within(one.at) or 0.0
        times = (within(one.for_), within(one.amount), one.within)
        found.append(Chosen(one.kind, target, at, *times))
    return tuple(found)


def fault_arguments(one: Chosen, began: float) -> list[str]:
    """Return a fault as words of `roco fault`; `began`: of the scenario [unix s]."""
    at = one.at if isinstance(one.at, str) else f"@{began + one.at:.3f}"
    how_much = KINDS[one.kind].amount
    option = how_much.option if how_much is not None else ""
    amount = [] if one.amount is None or option else [f"{one.amount:g}"]
    given = {option: one.amount} if option else {}
    options = {**given, "--at": at, "--for": one.for_, "--within": one.within}
    words = [(name, str(value)) for name, value in options.items() if value not in ("", None)]
    return [one.kind, one.target, *amount, *(word for pair in words for word in pair)]


# --- `roco fault run FILE --seed N` ---------------------------------------------------------------


HEAL_S = 100.0
"""Time to wait for the end of an interrupted fault [s]: a process may take 90 s to come back."""


def run(
    file: Annotated[Path, argument("A scenario (TOML).", exists=True, dir_okay=False)],
    seed: Annotated[int, option("Chooses what the scenario leaves open.", min=0)] = 1,
    target: targets.Name = "",
    run_dir: RunDir = None,
    form: Form = Format.TEXT,
) -> None:
    """Do the faults of a scenario, and wait until all are over; the same seed does the same.

    Exits with 1 where one did not begin, or a process did not come back. JSON has a fault a line.

    Examples:
      roco fault run faults.toml
      roco fault run faults.toml --seed 7
    """
    with problems(form), interrupts.heard():
        fleet = targets.find(target, run_dir)
        inflict.refuse(fleet)
        chosen = choose(load(file), seed)
        # UsageError before anything is done: a process or a moment that is not there
        for one in chosen:
            named(fleet, inflict.ends(fleet, one.target)[0])
            if isinstance(one.at, str):
                moments.parse(one.at, fleet.system.design, one.target)
        place = ["--target", target] if target else []
        place += ["--run-dir", str(run_dir)] if run_dir else []
        place += ["--format", form.value]
        heal_left(fleet, form)
        began = time.time()
        codes = _done([[*fault_arguments(one, began), *place] for one in chosen])
        if failed := sum(code != 0 for code in codes):
            wrong = f"{failed} of {len(codes)} faults did not go as they should"
            raise FleetError(f"{wrong}; `roco fault list` has them")


def _done(calls: list[list[str]]) -> list[int]:
    """Call `roco fault` with each of these, side by side; their exit codes. Ctrl-C ends them, each
    heals.
    """
    with contextlib.ExitStack() as all_of_them:
        roco, quiet = [sys.executable, "-P", "-m", "console", "fault"], subprocess.DEVNULL
        children = [
            all_of_them.enter_context(subprocess.Popen([*roco, *words], stdin=quiet))
            for words in calls
        ]
        try:
            return [child.wait() for child in children]
        except KeyboardInterrupt:
            for child in children:
                child.send_signal(signal.SIGINT)
            for child in children:
                with contextlib.suppress(subprocess.TimeoutExpired):
                    child.wait(HEAL_S)
            raise
