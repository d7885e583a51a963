"""The traffic that the verbs of `roco traffic` look at: what goes by in a running fleet, or what a recording holds.

Both are samples of a tap, so that whatever looks at the one looks at the other. A recording is read by a process of the
recorder, whose business recordings are.
"""

import os
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, cast

import msgspec

from agent_runtime.io.options import Options
from agent_runtime.io.run_files import KEYS_VARIABLE
from agent_runtime.io.secured import key_file
from agent_runtime.io.tap import RECORDER, Sample, open_tap
from agent_runtime.io.waiting import Waiting
from fipa_codec.communicate import Communicate, decode_strictly
from fipa_codec.errors import FipaError
from operate.cli.analysis import command, environment
from operate.cli.errors import NOTHING_RUNS, ConsoleError, NoRunError, UsageError
from operate.cli.fleet import identity, in_container, targets
from operate.cli.fleet.local import Local
from operate.cli.runs import folders
from operate.system import System, of_run

if TYPE_CHECKING:
    from operate.cli.fleet.compose import Compose

ROUTER_S = 5.0
"""Time to wait for a router [s] (estimate: it answers in milliseconds)."""
HOUSE = "_"
KEY_CHUNKS = 7
_decoder = msgspec.json.Decoder(Sample)


class NothingHeardError(ConsoleError):
    """No router answers where the fleet's should."""

    code = NOTHING_RUNS

    def __init__(self, options: Options) -> None:
        self.endpoint = options.connect
        super().__init__(
            f"no router answers at {options.connect}; is the fleet up (`roco status`)? Its recording is looked at with"
            f" --run {options.run_dir}"
        )


Samples = Iterator[Sample | None]
"""None: nothing came for a while; look at the clock."""


class Said(msgspec.Struct, frozen=True):
    """A communicate as it went by at `at` [unix s]: what its key says of it, and itself (None: it is none)."""

    at: float
    key: str
    data: bytes
    channel: str
    sender: str
    receiver: str
    protocol: str
    performative: str

    @property
    def size(self) -> int:
        """All of its bytes."""
        return len(self.data)

    def communicate(self) -> Communicate | None:
        """Return it decoded; None if it is not a communicate."""
        try:
            return decode_strictly(self.data)
        except FipaError:
            return None


def said(sample: Sample) -> Said | None:
    """Return the communicate, by its key; None for other samples (tokens, receipts, telemetry)."""
    chunks = sample.key.split("/")
    if sample.token or len(chunks) != KEY_CHUNKS or chunks[2] == HOUSE:
        return None
    channel, sender, receiver, protocol, performative = chunks[2:]
    return Said(sample.at, sample.key, sample.data, channel, sender, receiver, protocol, performative)


def at_run(run_dir: Path | None) -> Options:
    """Return the options that reach the router of a running fleet: from its folder, else (in a container) from the
    environment.

    Raises ConsoleError where no fleet was started.
    """
    around = folders.around()
    try:
        run = folders.find(run_dir)
        fleet = folders.living(run)
    except NoRunError:
        if run_dir is not None or around is None:
            raise
        run, fleet = Path(), None
    if fleet is None and around is not None and run_dir is None:
        keys = os.environ.get(KEYS_VARIABLE)
        return Options(connect=around.connect, system=around.system, run_dir=run, keys=Path(keys) if keys else None)
    if fleet is None:
        raise NoRunError(str(run), f"no fleet was started in {run}; `roco up` starts one")
    tls = identity.tls(run, fleet, identity.CONSOLE)
    folder = Path(tls["root_ca_certificate"]).parent if tls else None
    return Options(connect=fleet.connect, system=fleet.system, run_dir=run, keys=folder)


class Source:
    """Source of samples of a `system`: `live`, since `began` [unix s], or a recording."""

    def __init__(self, system: System, samples: Samples, waiting: Waiting | None) -> None:
        self.system, self._samples, self._waiting = system, samples, waiting
        self.live, self.began = waiting is not None, time.time()

    def samples(self, seconds: float = 0.0) -> Samples:
        """Yield samples for that many seconds; with 0 without end (of a recording: to its end)."""
        first: float | None = None
        for sample in self._samples:
            now = time.time() if self.live else sample.at if sample is not None else None
            first = self.began if self.live else now if first is None else first
            if seconds and now is not None and first is not None and now - first > seconds:
                return
            yield sample

    def lost(self) -> str:
        """Return a sentence on samples that could not be taken in time; "" if there are none."""
        dropped = self._waiting.dropped if self._waiting else 0
        return f"; {dropped} more came faster than they could be taken" if dropped else ""


def whose(options: Options) -> str:
    """The identity to listen by: the operator's, else (in the monitor's container) the recorder's."""
    there = options.keys is None or key_file(options.keys, identity.CONSOLE).is_file()
    return identity.CONSOLE if there else RECORDER


def meant(target: str, run_dir: Path | None) -> "Options | Compose":
    """Return the access to the running fleet that is meant: options of a session to its router, or its containers."""
    if not target and run_dir is None and folders.around():
        return at_run(None)
    fleet = targets.find(target, run_dir)
    return at_run(fleet.run) if isinstance(fleet, Local) else cast("Compose", fleet)


def about(file: Path | None, run_dir: Path | None, target: str = "") -> System:
    """The system of what `source` gives."""
    return targets.about(target, run_dir) if file is None else of_run(file)


@contextmanager
def source(file: Path | None, run_dir: Path | None, target: str = "") -> Iterator[Source]:
    """A recording where one is named, else the running fleet. Raises ConsoleError where there is none."""
    if file is not None:
        yield Source(of_run(file), recorded(file), None)
        return
    fleet = meant(target, run_dir)
    with _tapped(fleet) if isinstance(fleet, Options) else _piped(fleet) as heard:
        yield heard


@contextmanager
def _tapped(options: Options) -> Iterator[Source]:
    waiting, until = Waiting(), time.monotonic() + ROUTER_S
    tap = open_tap(options, waiting.put, lambda: time.monotonic() > until, whose(options))
    if tap is None:
        raise NothingHeardError(options)
    try:
        yield Source(of_run(options.run_dir), _without_end(waiting), waiting)
    finally:
        tap.close()


@contextmanager
def _piped(fleet: "Compose") -> Iterator[Source]:
    waiting = Waiting()
    with in_container.hearing(fleet.hearing()) as process:
        yield Source(fleet.system, in_container.samples(process, waiting), waiting)


def _without_end(waiting: Waiting) -> Samples:
    while True:
        yield waiting.get(in_container.PAUSE_S)


def recorded(file: Path, *, everything: bool = False) -> Samples:
    """Yield the contents of a run folder or a recording, in order. `everything`: not only communicates and tokens.

    Raises UsageError if no recording is found.
    """
    asked, pipe = command("said", str(file), *(["--everything"] if everything else [])), subprocess.PIPE
    with subprocess.Popen(asked, env=environment(of_run(file)), stdout=pipe, stderr=pipe) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        try:
            for line in process.stdout:
                yield _decoder.decode(line)
            words = process.stderr.read().decode(errors="replace").strip()
        finally:
            process.kill()
    if process.returncode > 0:
        raise UsageError(words.splitlines()[-1] if words else f"{file} cannot be read")
