"""`roco replay RUN --verify`: each agent of a run is run again from its step log, and must put out
the same bytes.

Each runs in a process of its own module (agent_runtime.io.steplog), so any system's agents can.
Where a step differs, the recorded value is looked up: in the log what was done, in the journal the
record, in the recording what went by.
"""

import subprocess
import sys
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from datetime import datetime
from itertools import pairwise, product
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import msgspec
import typer

from agent_runtime.core.events import Effects, Receipt
from agent_runtime.io.journal import records
from agent_runtime.io.steplog import Again, Parted, SentAgain, digest, fingerprint
from console.errors import ConsoleError, UsageError, last_line
from console.output import Form, tell
from console.runs import folders
from console.terminal.console import Console, table
from console.traffic.listen import fields_of
from console.traffic.play import as_agent, compared, difference
from fipa_codec.communicate import Communicate, decode
from operate.doing import doing
from operate.file_names import STEPS, TRAFFIC_FILE
from operate.system import System, of_run

if TYPE_CHECKING:
    from operate.recording.records import Garbage
    from operate.recording.run import Run

# --- First difference in the output of an agent's step that is run again: the field, its old value,
# its new value The log keeps a hash of a step's output. The journal has the records of the last
# life, the recording what was sent and receipted: what of it gives that hash again is what the step
# put out. Pure.


class Difference(msgspec.Struct, frozen=True):
    """The first step of an agent whose output differs, and in what: a field, its recorded value,
    its value now.

    `life`, `step`: which, by the agent's own count; `at`: when it was made [unix s]; `kind`: the
    event's class.
    """

    life: int
    step: int
    at: float
    kind: str
    field: str
    recorded: Any
    now: Any


class Kept(msgspec.Struct, frozen=True):
    """Stored evidence of an agent: its journal's records, and its communicates and receipts in the
    recording near the step.
    """

    journal: Sequence[bytes] = ()
    said: Sequence[Communicate] = ()
    receipts: Sequence[Receipt] = ()


def first(parted: Parted, kept: Kept) -> Difference:
    """Name it. Where what was put out is kept nowhere (`tells`: to devices), `recorded` is the hash
    of the output.
    """
    place = (parted.incarnation, parted.step, parted.at, parted.kind)
    return Difference(*place, *_named(parted, kept))


def _named(parted: Parted, kept: Kept) -> tuple[str, Any, Any]:
    put = parted.now
    if put is None:
        return "error", None, parted.error
    found = difference(_value_told(parted.deed), _value_told(put.deed), "deed")
    if found is not None:
        return found
    tells = cast(tuple[Any, ...], msgspec.Raw(put.tells))
    now = Effects(put.record, put.receipts, tuple(map(decode, put.sends)), tells)  # as it is hashed
    for was in _possible(parted, now, kept):
        # the same values in other bytes are in another order
        if fingerprint(was) == parted.output:
            return difference(_plain(was), _plain(now)) or ("record", was.record, now.record)
    then = next(_sent(parted.at, now.sends, kept.said))
    if found := difference(_fields(then), _fields(now.sends), "sends"):
        return found
    whole = kept.said and parted.before in kept.journal
    field, value = ("tells", _value_told(now.tells)) if whole else ("output", _plain(now))
    return field, f"hash {parted.output.hex()}", value


def _possible(parted: Parted, now: Effects, kept: Kept) -> Iterator[Effects]:
    """Yield the outputs that the step may have had, the likeliest first: each part as it is now, or
    as stored.
    """
    records = (now.record, *_after(parted.before, kept.journal), None)
    sends = (now.sends, *_sent(parted.at, now.sends, kept.said))
    receipts = (now.receipts, *_receipted(now.receipts, kept.receipts))
    for record, words, receipted, told in product(records, sends, receipts, (now.tells, ())):
        yield Effects(record, receipted, words, told)


def _after(before: bytes, journal: Sequence[bytes]) -> Iterable[bytes]:
    """The record that follows the one that was written last before the step; all where that one is
    another now.
    """
    if before not in journal:
        return journal
    return [later for one, later in pairwise(journal) if one == before][-1:]


def _sent(
    at: float, now: tuple[Communicate, ...], said: Sequence[Communicate]
) -> Iterator[tuple[Communicate, ...]]:
    """The same communicates as they were heard, with and without those that only one side has."""
    heard = {(one.receiver, one.id): one for one in said}
    then = [heard.get((one.receiver, one.id)) for one in now]
    mine = {(one.receiver, one.id) for one in now}
    more = [one for name, one in heard.items() if one.sent == at and name not in mine]
    both = tuple(one for one in then if one is not None)
    yield tuple(was or one for was, one in zip(then, now, strict=True))
    yield (*both, *more)
    yield both


def _receipted(now: tuple[Receipt, ...], then: Sequence[Receipt]) -> Iterator[tuple[Receipt, ...]]:
    """No receipt, or another one to the same peer, or one where there is none now."""
    yield ()
    for one in then:
        yield (*(other for other in now if other.peer != one.peer), one)


def _plain(effects: Effects) -> dict[str, Any]:
    return {
        "record": None if effects.record is None else msgspec.msgpack.decode(effects.record),
        "sends": _fields(effects.sends),
        "receipts": _value_told(effects.receipts),
        "tells": _value_told(effects.tells),
    }


def _value_told(value: Any) -> Any:
    return msgspec.msgpack.decode(msgspec.msgpack.encode(value))


def _fields(sends: Iterable[Communicate]) -> list[dict[str, Any]]:
    return [fields_of(one) for one in sends]


# --- Evidence from a recording about the agents of its run, for comparison with their output when
# they are run again


NEAR_S = 2.0
"""Time after a step within which its receipts are heard [s]; estimate: it takes milliseconds."""


Digests = defaultdict[tuple[str, str], set[bytes]]


class Evidence:
    """`setting`: of the fleet; `words`: agent -> (receiver, id) -> digests of all that went by
    under it.

    Without a recording there is nothing, and `there` is False.
    """

    def __init__(self, recording: "Run | None") -> None:
        from operate.recording.records import Setting, Spoken, communicate_in, setting_in

        self.there, self.setting = recording is not None, Setting(1, "1")
        self.words: defaultdict[str, Digests] = defaultdict(lambda: defaultdict(set))
        self._records = () if recording is None else recording.records
        self.said: list[Communicate] = []
        for record in self._records:
            self.setting = setting_in(record) or self.setting
            if (one := communicate_in(record)) is not None:
                self.said.append(one)
                wire = record.wire if isinstance(record, Spoken) else cast("Garbage", record).data
                self.words[one.sender][one.receiver, one.id].add(digest(wire))

    def receipts(self, agent: str, at: float) -> list[Receipt]:
        """Return its receipts that were heard about then, in order."""
        from operate.recording.ends import receipts
        from operate.recording.records import House

        house = (one for one in self._records if isinstance(one, House))
        near = (one for one in house if abs(one.received - at) < NEAR_S)
        return [one.receipt for one in receipts(near) if one.owner == agent]


# --- `roco replay RUN --verify` -------------------------------------------------------------------


JOURNAL = "journal"
RERUN_S = 600.0
"""Of one agent; estimate: an hour's steps are run again in seconds."""


class Verified(msgspec.Struct, frozen=True):
    """An agent run again. `steps`: those that put out what they put out then; `said`: different
    communicates among it.

    `heard`: those of `said` that the recording has with the same bytes; None without a recording.
    `unlogged`: others that it has of the agent: the log lacks the step, as after a kill -9.
    """

    agent: str
    lives: int
    steps: int
    said: int
    heard: int | None
    unlogged: int
    difference: Difference | None


def verified(file: Path, agents: list[str], seed: int | None, form: Form) -> None:
    """Do it and tell how it went. Exits with 1 where an agent's output differs. Raises
    ConsoleError.
    """
    run, system = file if file.is_dir() else file.parent, of_run(file)
    logs = _logs(run, system, agents)
    from operate.recording.run import opened

    recording = file if file.is_file() else run / TRAFFIC_FILE
    evidence = Evidence(opened(recording, system) if recording.is_file() else None)
    environment, found = _environment(run, system, evidence, seed), []
    for agent, log in logs.items():
        with doing(f"{agent} runs again"):
            found.append(_verified(run, _again(system, agent, log, environment), evidence))
    tell(found, form, lambda: _print(found))
    if any(one.difference for one in found):
        raise typer.Exit(1)


def _logs(run: Path, system: System, agents: list[str]) -> dict[str, Path]:
    """The step logs that are meant, by agent. Raises UsageError where there is none."""
    files = sorted((run / STEPS).glob(f"*.{STEPS}"))
    there = {path.stem: path for path in files if path.stem in system.design.agents}
    if not there:
        raise UsageError(
            f"{run / STEPS} has no step logs; give the folder of a run, as `roco up` wrote it"
        )
    for agent in agents:
        if agent not in there:
            raise UsageError(f"{run / STEPS} has no log of {agent!r}; it has {', '.join(there)}")
    return {agent: log for agent, log in there.items() if not agents or agent in agents}


def _environment(run: Path, system: System, evidence: Evidence, seed: int | None) -> dict[str, str]:
    """The environment in which the agents of the run were started, as far as their steps depend on
    it.
    """
    was, fleet = evidence.setting, folders.fleet(run)
    name, seed = fleet.system if fleet else system.name, was.seed if seed is None else seed
    settings = {"SYSTEM": name, "SPEED": was.speed, "SCENE": was.scene, "SEED": str(seed)}
    return as_agent(system, run, settings)


def _again(system: System, agent: str, log: Path, environment: dict[str, str]) -> Again:
    """An agent run again by a process of its own module. Raises ConsoleError where that fails."""
    modules = {one.name: one.module for one in system.processes}
    if agent not in modules:
        raise UsageError(f"the system has no process {agent!r}; {', '.join(modules)} are")
    command = [sys.executable, "-P", "-m", modules[agent]]
    settings = environment | {"ROCO_REPLAY": str(log.resolve())}
    try:
        done = subprocess.run(command, env=settings, capture_output=True, timeout=RERUN_S)
        return msgspec.msgpack.decode(done.stdout, type=Again)
    except subprocess.TimeoutExpired as error:
        late = f"{agent} has not run its steps again in {RERUN_S:.0f} s; give a shorter run"
        raise ConsoleError(late) from error
    except msgspec.MsgspecError as error:
        why = last_line(done.stderr) or "it says nothing"
        raise ConsoleError(f"{agent} could not run its steps again: {why}") from error


def _verified(run: Path, done: Again, evidence: Evidence) -> Verified:
    heard, said = evidence.words[done.agent], {(one.receiver, one.id): one for one in done.said}
    found: Difference | None
    if done.parted is not None:
        journal = run / JOURNAL / f"{done.agent}.{JOURNAL}"
        kept = tuple(records(journal.read_bytes())) if journal.is_file() else ()
        receipts = evidence.receipts(done.agent, done.parted.at)
        own = [one for one in evidence.said if one.sender == done.agent]
        found = first(done.parted, Kept(kept, own, receipts))
    else:
        both = [one for place, one in said.items() if place in heard]
        others = (one for one in both if one.digest not in heard[one.receiver, one.id])
        found = next((_misheard(one, heard[one.receiver, one.id]) for one in others), None)
    alike = sum(one.digest in heard.get(place, ()) for place, one in said.items())
    return Verified(
        agent=done.agent,
        lives=done.lives,
        steps=done.steps,
        said=len(said),
        heard=alike if evidence.there else None,
        unlogged=0 if done.parted is not None else len(heard.keys() - said.keys()),
        difference=found,
    )


def _misheard(one: SentAgain, heard: set[bytes]) -> Difference:
    field = f"recording of the communicate {one.id} to {one.receiver}"
    was, now = (f"digest {digest.hex()}" for digest in (min(heard), one.digest))
    return Difference(one.incarnation, one.step, one.at, one.kind, field, was, now)


def _print(found: list[Verified]) -> None:
    heads = ("agent", "lives", "steps", "said", "heard")
    drawn = table(heads, right=heads[1:])
    for one in found:
        heard = "-" if one.heard is None else str(one.heard)
        drawn.add_row(one.agent, str(one.lives), str(one.steps), str(one.said), heard)
    Console(highlight=False).print(drawn)
    for one in found:
        if one.unlogged:
            lost = "more were heard, of steps that its log lost, as a kill -9 does"
            print(f"{one.agent}: {one.unlogged} {lost}")
    odd = [(one.agent, one.difference) for one in found if one.difference is not None]
    for agent, first in odd:
        at = datetime.fromtimestamp(first.at).strftime("%H:%M:%S.%f")[:-3]
        print(
            f"{agent} differs first in step {first.step} of life {first.life}, {at}, {first.kind}"
        )
        print(f"  in {first.field}\n{compared(first.recorded, first.now)}")
    if not odd:
        steps = sum(one.steps for one in found)
        print(f"{len(found)} agents, {steps} steps: each put out the same bytes as then")
