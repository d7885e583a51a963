"""A cell of chaos: one fault of one process in one phase of the system's job; which one, a seed says. Pure."""

import random

import msgspec

from agent_runtime.io.secured import ROUTER
from operate.cli.errors import UsageError
from operate.cli.faults.kinds import KINDS, VERBS, Kind
from operate.system import System

PAUSE_S = 3.0
"""Estimate: longer than the lease of a session, shorter than a hang is suffered."""
MESSAGE, MESSAGES = "a message", (1, 10)
"""A phase of any job: the Nth message to or from an agent; estimate: each job has at least N."""


class Cell(msgspec.Struct, frozen=True):
    """`at`: the moment as --at has it; `for_s`, `amount`: None where the fault is done without."""

    seed: int
    kind: str
    target: str
    phase: str
    at: str
    for_s: float | None = None
    amount: float | None = None

    @property
    def words(self) -> str:
        """The action in words: "pause mule by 3 at mule:fetching"."""
        by = f" by {self.amount:g}" if self.amount is not None else ""
        return f"{self.kind} {self.target}{by} at {self.at if self.phase == MESSAGE else self.phase}"

    @property
    def command(self) -> list[str]:
        """The words of `roco fault`."""
        row = KINDS[self.kind].amount
        amount = [] if self.amount is None or row is None else [*([row.option] if row.option else []), str(self.amount)]
        return [self.kind, self.target, *amount, "--at", self.at, *(["--for", str(self.for_s)] if self.for_s else [])]


def phases(system: System) -> dict[str, str]:
    """Return the phases of a system's job: its own, else the states of its agents but the first ones."""
    agents = system.design.agents
    states = (f"{name}:{one.name}" for name in agents for one in agents[name].state if one.name != agents[name].initial)
    return system.job.phases or {state: state for state in states}


def choose(system: System, seed: int, kinds: tuple[str, ...], targets: tuple[str, ...]) -> Cell:
    """Return the cell of a seed, among these kinds and targets; () all. Raise UsageError: none fits."""
    chance = random.Random(seed)
    for _ in range(1000):
        kind = chance.choice(kinds or VERBS)
        fitting = [name for name in targets_of(system, KINDS[kind]) if not targets or name in targets]
        if fitting:
            return cell(system, seed, kind, chance.choice(fitting), *_moment(system, chance), chance)
    raise UsageError(f"{', '.join(kinds)} can be done to none of {', '.join(targets)}; leave --kind or --on out")


def cell(system: System, seed: int, kind: str, target: str, phase: str, at: str, chance: random.Random) -> Cell:
    """Return a cell whose amount is chosen."""
    row = KINDS[kind]
    amount = None if row.amount is None else round(chance.uniform(*row.amount.tried), 3)
    return Cell(seed, kind, target, phase, at, PAUSE_S if kind == "pause" else row.for_s or None, amount)


def targets_of(system: System, kind: Kind) -> tuple[str, ...]:
    """Return the processes that a kind of faults can be done to."""
    names = tuple(one.name for one in system.processes)
    agents = tuple(name for name in names if name in system.design.agents)
    return (*agents, ROUTER) if kind.wire else agents if kind.agents else names


def check(kinds: tuple[str, ...], targets: tuple[str, ...], system: System) -> None:
    """Raise UsageError for an unknown kind or process, with the known ones."""
    for given, there, what in (
        (kinds, VERBS, "kind of fault"),
        (targets, tuple(one.name for one in system.processes), "process"),
    ):
        if unknown := [name for name in given if name not in there]:
            raise UsageError(f"there is no {what} {unknown[0]!r}; there are {', '.join(there)}")


def _moment(system: System, chance: random.Random) -> tuple[str, str]:
    """Return a phase and its moment: one of the job's; where it names none, a state or, as often, a message."""
    if system.job.phases or chance.random() < 0.5:
        return chance.choice(list(phases(system).items()))
    return MESSAGE, f"{chance.randint(*MESSAGES)}-message"
