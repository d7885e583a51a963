"""The traffic that the verbs of `roco traffic` look at: what goes by in a running fleet, or what a
recording holds.

Both are samples, so that whatever looks at the one looks at the other. What goes by is told by a
process of the recorder: here, or in the container of a fleet's monitor.

A subject of `conversation`, `trace` and `why` is a conversation, CONVERSATION or, where an agent
has it with several, CONVERSATION/PARTICIPANT. A task is the conversation that opened it.
"""

import os
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, cast

import msgspec
import typer

from agent_runtime.io.options import Options
from agent_runtime.io.run_files import KEYS_VARIABLE
from agent_runtime.io.tap import Sample, Waiting
from console import completion
from console.errors import NO, NOTHING_RUNS, ConsoleError, NoRunError, UsageError, last_line
from console.fleet import identity, targets
from console.fleet.local import Local
from console.output import argument, option
from console.runs import folders
from console.runs.folders import judged, verdicts_of
from fipa_codec.communicate import Communicate, decode_strictly
from fipa_codec.errors import FipaError
from operate.filters import Filter, UnknownNameError, checked
from operate.structs import NothingToRead
from operate.system import NoSystemError, System, of_run
from operate.verdict_lines import Judged
from topdown.model.design import Design

if TYPE_CHECKING:
    from console.fleet.compose import Compose


HOUSE = "_"
KEY_CHUNKS = 7
RECORDING = "operate.recording"
"""The module whose `hear` prints what goes by."""


Samples = Iterator[Sample | None]
"""None: nothing came for a while; look at the clock."""


class HeardMessage(msgspec.Struct, frozen=True):
    """A communicate as it was taken at `at` [unix s]: what its key says of it, its size [bytes],
    and itself.
    """

    at: float
    key: str
    data: bytes
    size: int
    channel: str
    sender: str
    receiver: str
    protocol: str
    performative: str

    def communicate(self) -> Communicate | None:
        """Return it decoded; None if it is not a communicate."""
        try:
            return decode_strictly(self.data)
        except FipaError:
            return None


def fields_of(one: Communicate) -> dict[str, Any]:
    """A communicate by the names of its fields, its content as what it is; without `content` where
    it has none.
    """
    told = msgspec.structs.asdict(one)
    content = told.pop("content")
    return told if content is msgspec.UNSET else told | {"content": msgspec.msgpack.decode(content)}


def heard_message(sample: Sample) -> HeardMessage | None:
    """Return the communicate, by its key; None for other samples (tokens, receipts, telemetry)."""
    chunks = sample.key.split("/")
    if sample.token or len(chunks) != KEY_CHUNKS or chunks[2] == HOUSE:
        return None
    return HeardMessage(
        sample.at, sample.key, sample.data, sample.size or len(sample.data), *chunks[2:]
    )


def at_run(run_dir: Path | None) -> Options:
    """Return the options that reach a running fleet: from its folder, else (in a container) from
    the environment.

    Raises ConsoleError where no fleet was started.
    """
    around = folders.around() if run_dir is None else None
    try:
        run = folders.find(run_dir)
        fleet = folders.living(run)
    except NoRunError:
        if around is None:
            raise
        run, fleet = Path(), None
    if fleet is None and around is not None:
        text = os.environ.get(KEYS_VARIABLE)
        keys = Path(text) if text else None
        return Options(connect=around.connect, system=around.system, run_dir=run, keys=keys)
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


def meant(target: str, run_dir: Path | None) -> "Options | Compose":
    """Return the access to the running fleet that is meant: options that reach it, or its
    containers.
    """
    if not target and run_dir is None and folders.around():
        return at_run(None)
    fleet = targets.find(target, run_dir)
    return at_run(fleet.run) if isinstance(fleet, Local) else cast("Compose", fleet)


def about(file: Path | None, run_dir: Path | None, target: str = "") -> System:
    """The system of what `source` gives."""
    return targets.about(target, run_dir) if file is None else of_run(file)


@contextmanager
def source(file: Path | None, run_dir: Path | None, target: str = "") -> Iterator[Source]:
    """A recording where one is named, else the running fleet. Raises ConsoleError where there is
    none.
    """
    if file is not None:
        yield Source(of_run(file), recorded(file), None)
        return
    waiting = Waiting()
    with hearing(run_dir, target) as (system, process):
        yield Source(system, _printed(process, waiting), waiting)


@contextmanager
def hearing(
    run_dir: Path | None, target: str = ""
) -> Iterator[tuple[System, "subprocess.Popen[bytes]"]]:
    """The process that prints what goes by in the running fleet. Raises ConsoleError where there is
    none.
    """
    fleet = meant(target, run_dir)
    if isinstance(fleet, Options):
        system, words = of_run(fleet.run_dir), [sys.executable, "-P", "-m", RECORDING, "hear"]
        words += ["--connect", fleet.connect, "--system", fleet.system]
        words += ["--run-dir", str(fleet.run_dir), "--keys", str(fleet.keys or "")]
    else:
        system, words = fleet.system, fleet.hearing()
    with _process(words, os.environ | system.environment(Path())) as process:
        yield system, process


def recorded(file: Path, *, everything: bool = False) -> Samples:
    """Yield the contents of a run folder or a recording, in order. `everything`: not only
    communicates and tokens.

    Raises NothingToRead if no recording is found.
    """
    from operate.recording.run import opened

    yield from opened(file).samples(everything=everything)


# --- The process that prints what goes by ---------------------------------------------------------


END_S = 5.0
"""Time to wait for its end [s] (estimate: it takes a tenth)."""
PAUSE_S = 0.1
"""Silence after which the listener gets something else to do [s]."""
NO_ROUTER = 3
"""Its exit code where no router answers."""


class LostError(ConsoleError):
    """The process ended, and nobody had asked it to; its last words say why."""

    def __init__(self, process: "subprocess.Popen[bytes]") -> None:
        assert process.stderr is not None
        why = last_line(process.stderr.read()) or "its monitor was stopped"
        unheard = process.returncode == NO_ROUTER
        self.code = NOTHING_RUNS if unheard else NO
        super().__init__(why if unheard else f"nothing more is heard of the fleet: {why}")


@contextmanager
def _process(
    command: list[str], environment: Mapping[str, str]
) -> Iterator["subprocess.Popen[bytes]"]:
    """The process, until the end of the block; Ctrl-C in the terminal does not reach it."""
    pipe = subprocess.PIPE
    with subprocess.Popen(
        command, env=environment, stdin=pipe, stdout=pipe, stderr=pipe, start_new_session=True
    ) as process:
        try:
            yield process
        finally:
            assert process.stdin is not None
            process.stdin.close()
            try:
                process.wait(END_S)
            except subprocess.TimeoutExpired:
                process.kill()


def _printed(process: "subprocess.Popen[bytes]", waiting: Waiting) -> Iterator[Sample | None]:
    """Yield the samples that the listening process prints, and None after a pause without any.
    Raise LostError when that process ends.
    """
    assert process.stdout is not None
    threading.Thread(target=waiting.fill, args=(process.stdout,), daemon=True).start()
    while not waiting.stopped:
        yield waiting.get(PAUSE_S)
    yield from waiting.left()
    process.wait(END_S)
    raise LostError(process)


# --- Options by which verbs are told what is meant: messages, for how long, which run, which
# subject


Names = list[str] | None
_CHANNEL = "Only on this channel; may be repeated."
_AGENT = "Only from or to this agent; may be repeated."
_PROTOCOL = "Only of this protocol; may be repeated."
_ACT = "Only this act; may be repeated."
Channels = Annotated[Names, option(_CHANNEL, "--channel", complete=completion.channels)]
Agents = Annotated[Names, option(_AGENT, "--agent", complete=completion.agents)]
Protocols = Annotated[Names, option(_PROTOCOL, "--protocol", complete=completion.protocols)]
Performatives = Annotated[Names, option(_ACT, "--performative", complete=completion.performatives)]
Recorded = Annotated[
    Path | None,
    option(
        "A recording, or the folder of a run that has one; else a running fleet.",
        "--run",
        complete=completion.runs,
    ),
]
Wrong = Annotated[bool, option("Only what is against the design.", "--wrong")]
Count = Annotated[int, option("End after so many communicates; 0: go on.", "--count", min=0)]
Seconds = Annotated[
    float, option("End after so many seconds; 0: go on till Ctrl-C.", "--for", min=0.0)
]


def wanted(
    design: Design,
    channels: list[str] | None,
    agents: list[str] | None,
    protocols: list[str] | None,
    performatives: list[str] | None,
) -> Filter:
    """The filter. Raises UsageError for a name that the design does not have."""
    named = (tuple(names or ()) for names in (channels, agents, protocols, performatives))
    try:
        return checked(Filter(*named), design)
    except UnknownNameError as error:
        raise UsageError(str(error)) from error


def lines_of(run: Path | None, target: str, run_dir: Path | None) -> list[Judged]:
    """The verdicts about a run: of the fleet that is meant as its monitor judged it so far, else as
    judged now.
    """
    if run is None:
        return targets.find(target, run_dir).verdicts()
    return verdicts_of(run) if run.is_dir() else judged(run)


def recording_of(run: Path | None, target: str, run_dir: Path | None) -> Path:
    """Return a run folder or a recording. Raise ConsoleError where there is none, UsageError for
    containers.
    """
    if run is not None:
        if not run.exists():
            raise UsageError(
                f"{run} is not there; give a run folder, or a recording of `roco record`"
            )
        return run
    found = targets.find(target, run_dir)
    if not isinstance(found, Local):
        raise UsageError(
            f"{found.where} runs in containers; `roco record FILE` records it, then --run FILE"
        )
    return found.run


def names(ctx: typer.Context, incomplete: str) -> list[str]:
    """Return the conversations of the run that the options before the word name, for the shell to
    complete.
    """
    recording, run_dir = (completion.path_given(ctx, name) for name in ("run", "run_dir"))
    try:
        lines = lines_of(recording, ctx.params.get("target") or "", run_dir)
    except (ConsoleError, NoSystemError, NothingToRead, ModuleNotFoundError):
        return []
    return completion.among(dict.fromkeys(one.conversation for one in lines), incomplete)


Subject = Annotated[
    str,
    argument(
        "A conversation, as `roco conversation` lists it; of a task the one that opened it.",
        complete=names,
    ),
]
