"""`roco fault KIND PROCESS`, `run`, `list`, `heal`: faults done on purpose, recorded, healed at the
end.
"""

import contextlib
import math
import os
import random
import signal
import subprocess
import sys
import time
import tomllib
from collections.abc import Callable, Sequence
from datetime import datetime
from functools import partial
from pathlib import Path
from typing import Annotated

import msgspec

from console import completion, interrupts
from console.errors import FleetError, UsageError
from console.faults import inflict, moments
from console.faults.kinds import AMOUNTS, KINDS, UNTIMED, VERBS, Kind
from console.fleet import targets
from console.fleet.targets import named
from console.output import (
    Form,
    Format,
    Reply,
    RunDir,
    argument,
    option,
    tell,
    tell_json,
    tell_problem,
)
from console.terminal.console import Console, table
from operate import proc
from operate.fault_lines import Fault, latest, read
from operate.quantiles import quantile

Process = Annotated[str, argument("A process.", complete=targets.processes, metavar="PROCESS")]
At = Annotated[
    str,
    option(
        "When it begins: seconds from now, a state (STATE or AGENT:STATE), the Nth message of"
        " the process (3rd-message), an event of the run (event:NAME) or a step of the plan"
        " (plan:STEP); else at once.",
        "--at",
        complete=completion.moments,
        metavar="MOMENT",
    ),
]
Within = Annotated[float, option("Seconds to wait for the moment.", "--within", min=0.1)]
HEADS = ("begun", "fault", "lasted", "what came of it")
WITHIN_S = 300.0
"""Estimate: longer than a pour on a loaded machine."""
EVERY_S = 0.1
"""The shortest period of a repeated fault [s]; estimate: two looks at the process."""


class Faults(msgspec.Struct, frozen=True):
    """`roco fault list --format json`. `healed`: those whose command was gone, just now."""

    where: str
    faults: tuple[Fault, ...]
    healed: tuple[Fault, ...]


def kinds(incomplete: str) -> list[str]:
    """The kinds of faults for the shell to complete, and the verbs that begin with `fault`."""
    from console.lazy import added
    from console.verbs import VERBS as TABLE
    from console.verbs import merged

    rows = [words for panel in merged(TABLE, added()).values() for words in panel]
    below = [words.removeprefix("fault ") for words in rows if words.startswith("fault ")]
    return completion.among((*VERBS, *below), incomplete)


def fault(
    kind: Annotated[str, argument("What is done to it.", complete=kinds, metavar="KIND")],
    process: Process,
    amount: Annotated[
        float | None,
        argument("delay, clock: seconds; loss, corrupt: a share; rate: bytes.", metavar="[AMOUNT]"),
    ] = None,
    per_second: Annotated[
        float | None, option("flood: so many a second; else 500.", min=1.0)
    ] = None,
    speaker: Annotated[
        str,
        option(
            "flood: who floods, the operator or a peer.",
            "--as",
            complete=completion.agents,
            metavar="NAME",
        ),
    ] = "",
    at: At = "",
    for_: Annotated[
        float | None,
        option("Seconds until it is healed; else as its kind has it.", "--for", min=0.0),
    ] = None,
    within: Within = WITHIN_S,
    every: Annotated[
        float | None,
        option("Seconds from one begin to the next; needs --times.", "--every", min=EVERY_S),
    ] = None,
    times: Annotated[
        int | None, option("How often it is done; needs --every.", "--times", min=1)
    ] = None,
    target: targets.Name = "",
    run_dir: RunDir = None,
    form: Form = Format.TEXT,
) -> None:
    """Do a fault to a process of a running fleet, record it, and heal it at its end.

    kill: kill a process (SIGKILL), and wait until it is back; with --for it is kept down so long.

    hang: let it hang (SIGSTOP) until somebody ends it: who supervises it, `roco fault heal`, or the
    time --for.

    pause: give it no processor for a time (SIGSTOP, then SIGCONT).

    restart: end it in order (SIGTERM) in the middle of its work, and wait until it is back.

    cut: cut the wires of an agent, as if its plug were pulled; a router: all to it; AGENT-PEER: the
    link of the two.

    delay: delay what passes the wires of an agent, each way, by AMOUNT seconds.

    loss: lose a share of what passes the wires of an agent; TCP sends it again, later.

    rate: bound the rate of the wires of an agent, in bytes per second each way.

    corrupt: turn over a bit in a share of what passes the wires of an agent.

    disk-full: let what it writes to files fail, as if its disk were full (EFBIG), until it ends or
    the time is over.

    flood: flood an agent with orders of the operator, or with copies of what another agent says to
    it (--as).

    clock: step the wall clock of an agent, forward or below 0 back; its monotonic clock goes on as
    it was.

    Examples:
      roco fault kill AGENT
      roco fault kill AGENT --at 10th-message
      roco fault kill AGENT --every 20 --times 15
      roco fault kill router --for 5
      roco fault hang monitor --for 10
      roco fault pause AGENT --for 1.5
      roco fault pause router --for 3 --at 20
      roco fault restart AGENT --at 3rd-message
      roco fault cut AGENT-PEER
      roco fault cut AGENT --for 1 --at 5th-message
      roco fault delay AGENT 0.2
      roco fault loss AGENT 0.05 --for 10
      roco fault rate AGENT 20000
      roco fault corrupt AGENT 0.01
      roco fault disk-full monitor --for 10
      roco fault flood AGENT --as PEER --per-second 2000 --for 10
      roco fault clock AGENT -3600
    """
    with interrupts.heard():
        if kind not in VERBS:
            raise UsageError(f"there is no kind of fault {kind!r}; there are {', '.join(VERBS)}")
        row = KINDS[kind]
        much = amount_of(kind, row, amount, per_second)
        if speaker and not row.speaker:
            raise UsageError(f"nobody speaks in a fault of kind {kind}; leave --as out")
        if for_ is not None and row.for_s is None:
            raise UsageError(f"{kind} has no --for: it is over when the process is back")
        if (every is None) != (times is None):
            raise UsageError("--every and --times go together: --every 20 --times 15")
        for_s = for_ if for_ is not None else row.for_s or 0.0
        fleet = targets.find(target, run_dir)
        inflict.refuse(fleet)
        moment = moments.parse(at, fleet.system.design, process)
        heal_left(fleet, form)
        done = row.timed if row.timed and for_s else kind
        told = print if form is Format.TEXT else lambda _: None

        def once(at: str, wait: Callable[[], None]) -> Fault:
            planned = inflict.planned(fleet, done, process, at, much, speaker)
            ended = inflict.Inflicting(fleet, planned).run(wait, for_s, told)
            tell(ended, form, f"{ended.words}: {ended.text}, {lasted(ended):.1f} s")
            return ended

        first = partial(
            once,
            moments.moment_text(moment),
            partial(moments.wait, moment, within, target, run_dir),
        )
        if every is None or times is None:
            first()
        else:
            repeat(first, partial(once, "", lambda: None), every, times, form)


class Repeated(msgspec.Struct, frozen=True):
    """The last line of `roco fault KIND --every --format json`: how often it was asked for and
    done, how long the faults lasted, and the time from the first begin to the last end [s].
    """

    asked: int
    done: int
    median_s: float | None
    longest_s: float | None
    total_s: float
    span_s: float

    @property
    def words(self) -> str:
        """A line for people."""
        text = f"{self.done} of {self.asked} done"
        if self.median_s is None:
            return text
        return (
            f"{text}; lasted {self.median_s:.1f} s (median), {self.longest_s:.1f} s (longest),"
            f" {self.total_s:.1f} s of {self.span_s:.0f} s in all"
        )


def repeated(asked: int, faults: Sequence[Fault]) -> Repeated:
    """Return the figures of faults that ended."""
    times = [lasted(one) for one in faults]
    span_s = (faults[-1].ended or 0.0) - faults[0].began if faults else 0.0
    longest_s = max(times, default=None)
    return Repeated(asked, len(times), quantile(times, 0.5), longest_s, math.fsum(times), span_s)


def repeat(
    first: Callable[[], Fault], again: Callable[[], Fault], every: float, times: int, form: Form
) -> None:
    """Do a fault `times` times, `every` seconds [s] from begin to begin; one that lasts longer
    delays the next. Print the figures at the end, also where one raises FleetError or is
    interrupted.
    """
    faults: list[Fault] = []
    try:
        faults.append(first())
        for number in range(1, times):
            time.sleep(max(0.0, faults[0].began + number * every - time.time()))
            faults.append(again())
    finally:
        figures = repeated(times, faults)
        tell(figures, form, figures.words)


def amount_of(kind: str, row: Kind, amount: float | None, per_second: float | None) -> float:
    """The amount of a fault, 0 for a kind without. Raise UsageError where it is missing, wrong, or
    of another kind.
    """
    has = row.amount
    optional = has is not None and has.option != ""
    if per_second is not None and not optional:
        raise UsageError(f"{kind} has no --per-second; a flood has")
    if amount is not None and (has is None or optional):
        raise UsageError(f"{kind} has no amount; leave {amount:g} out")
    if has is None:
        return 0.0
    given = per_second if optional else amount
    given = given if given is not None else has.default
    if given is None:
        raise UsageError(f"{kind} needs {has.metavar} behind the process: {has.text}")
    least, most = has.least, has.most
    if (least is not None and given < least) or (most is not None and given > most):
        bounds = f"{least:g} at least" + (f", {most:g} at most" if most is not None else "")
        raise UsageError(f"{kind}: {has.metavar} is {given:g}; it must be {bounds}")
    return given


def heal_left(fleet: targets.Target, form: Format) -> None:
    """Heal the faults whose command is gone, and tell of each."""
    for one in inflict.heal(fleet, inflict.left(fleet)):
        tell_problem(f"{one.words}: its command was gone; healed", form)


def list_(target: targets.Name = "", run_dir: RunDir = None, form: Form = Format.TEXT) -> None:
    """List the faults of a run; those whose command was killed are healed first.

    Examples:
      roco fault list
      roco fault list --format json
    """
    fleet = targets.find(target, run_dir)
    healed = inflict.heal(fleet, inflict.left(fleet))
    # in the order of their beginnings; those that wait or never began stand last
    every = tuple(sorted(latest(read(fleet.faults())), key=lambda one: one.began or math.inf))
    if form is Format.JSON:
        tell_json(Faults(fleet.where, every, tuple(healed)))
    elif every:
        Console().print(table(HEADS, map(_row, every), fold=HEADS))
    else:
        print(f"no fault was done to {fleet.where}")


def heal(target: targets.Name = "", run_dir: RunDir = None, form: Form = Format.TEXT) -> None:
    """Heal all faults that go on, also those of commands that run.

    Examples:
      roco fault heal
    """
    fleet = targets.find(target, run_dir)
    healed = inflict.heal(fleet, inflict.open_faults(fleet))
    words = "\n".join(f"{one.words}: healed" for one in healed) or "no fault goes on"
    tell(Reply(words, fleet.where), form)


def lasted(fault: Fault) -> float:
    """Return how long a fault lasted [s]; so far, where it goes on."""
    return (fault.ended or fault.t) - fault.began if fault.began else 0.0


def _row(one: Fault) -> tuple[str, ...]:
    began = f"{datetime.fromtimestamp(one.began):%H:%M:%S}" if one.began else "–"
    now = one.text or ("goes on" if one.began else "waits for its moment")
    return began, one.words, f"{lasted(one):.1f} s" if one.ended else "", now


# --- `roco fault run FILE --seed N`: a scenario, each fault of it a `roco fault` of its own


# --- A scenario: faults in a TOML file, of which a seed chooses what the file leaves open. Pure but
# for `load`
# [[fault]]
# kind = "delay"            # a verb of `roco fault`
# target = ["mule", "ox"]   # one of them
# at = [0.0, 5.0]           # some time between; or as --at has it
# for = 2.0                 # a number, or [least, most], as amount
# amount = [0.05, 0.2]
# every = 20                # again each 20 s
# times = 15                # so often; needs every


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
    every: float | None = None
    times: int | None = None


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
    every: float | None = None
    times: int | None = None


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
        if why := _entry_fault(entry):
            raise UsageError(f"{file}: fault {number}: {why}")
    return scenario


def _entry_fault(entry: Entry) -> str:
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
    if (entry.every is None) != (entry.times is None):
        return "`every` and `times` go together"
    if entry.every is not None and not EVERY_S <= entry.every < math.inf:
        return f"every = {entry.every:g} is no number from {EVERY_S:g} on"
    if entry.times is not None and entry.times < 1:
        return f"times = {entry.times} is below 1"
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
        spans = (within(one.for_), within(one.amount))
        found.append(Chosen(one.kind, target, at, *spans, one.within, one.every, one.times))
    return tuple(found)


def fault_arguments(one: Chosen, began: float) -> list[str]:
    """Return a fault as words of `roco fault`; `began`: of the scenario [unix s]."""
    at = one.at if isinstance(one.at, str) else f"@{began + one.at:.3f}"
    how_much = KINDS[one.kind].amount
    option = how_much.option if how_much is not None else ""
    amount = [] if one.amount is None or option else [f"{one.amount:g}"]
    given = {option: one.amount} if option else {}
    options = {**given, "--at": at, "--for": one.for_, "--within": one.within}
    options |= {"--every": one.every, "--times": one.times}
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
    with interrupts.heard():
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
        began = time.time() + _lead_s(len(chosen))
        codes = _done([[*fault_arguments(one, began), *place] for one in chosen])
        if failed := sum(code != 0 for code in codes):
            wrong = f"{failed} of {len(codes)} faults did not go as they should"
            raise FleetError(f"{wrong}; `roco fault list` has them")


def _lead_s(count: int) -> float:
    """Return how long so many commands need until all wait for their moments [s]: each as long as
    this one needed so far, as many at a time as there are processors.
    """
    since_boot = proc.started(os.getpid()) / os.sysconf("SC_CLK_TCK")
    needed = time.clock_gettime(time.CLOCK_BOOTTIME) - since_boot
    return needed * max(1.0, count / (os.cpu_count() or 1))


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
