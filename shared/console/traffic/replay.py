"""`roco replay`: what a recording holds is said again, with its timing, where no robot hears it.

By default on a router and under a system name of its own; never where an agent of that system
lives.
"""

import contextlib
import shutil
import time
from collections.abc import Iterator
from datetime import datetime
from pathlib import Path
from typing import Annotated

import msgspec

from agent_runtime.core.errors import RuntimeFault
from agent_runtime.impersonation import Stage
from agent_runtime.io.run_files import make_run, write_whole
from agent_runtime.io.steplog import StepLogs
from agent_runtime.io.tap import Sample
from console import completion
from console.errors import ConsoleError, UsageError
from console.output import Form, Format, argument, option, tell
from console.runs import folders
from console.terminal.console import Console
from console.traffic import replace, verify
from console.traffic.listen import (
    HOUSE,
    Agents,
    Channels,
    Performatives,
    Protocols,
    heard_message,
    recorded,
    wanted,
)
from console.traffic.play import Player, Replayed, sentence
from operate.doing import doing
from operate.file_names import FLEET_FILE, LIVE_FILE, STEPS
from operate.filters import Filter
from operate.fleet_file import Fleet
from operate.system import System, of_run

SYSTEM = "replay"
PUBLISHED = ("telemetry", "truth", "state")
"""Kinds published for people beside communicates; --telemetry replays them, too."""
KIND = 3
"""Index of the chunk of a key that names its kind, unless it is a communicate's."""
READ_S = 0.5
"""Until listeners have read the last message: they look every 0.05 s at what is 0.1 s old
(estimate).
"""
FOREVER = 1 << 62


def replay(
    file: Annotated[
        Path,
        argument("A recording, or the folder of a run that has one.", complete=completion.runs),
    ],
    speed: Annotated[
        str, option("So many times as fast as it was recorded, or max.", complete=completion.speeds)
    ] = "1",
    loop: Annotated[bool, option("Again and again until Ctrl-C.", "--loop")] = False,
    only: Annotated[
        list[str] | None,
        option(
            "Only KIND=NAME[,NAME]: channel=C4, performative=inform, ...",
            complete=completion.choices,
        ),
    ] = None,
    channel: Channels = None,
    agent: Agents = None,
    protocol: Protocols = None,
    performative: Performatives = None,
    telemetry: Annotated[
        bool, option("Also what robot and agents publish.", "--telemetry")
    ] = False,
    replace_: Annotated[
        str,
        option(
            "Run this agent; the others are as recorded.", "--replace", complete=completion.agents
        ),
    ] = "",
    verify_: Annotated[
        bool, option("Run all agents again offline: do they put out the same bytes?", "--verify")
    ] = False,
    seed: Annotated[
        int | None, option("With --replace or --verify: the agent's seed; else the recorded one.")
    ] = None,
    system: Annotated[str, option("The system's name in all keys.")] = SYSTEM,
    connect: Annotated[str, option("A router to say it on; else one of its own.")] = "",
    after: Annotated[float, option("Begin after so many seconds.", min=0.0)] = 0.0,
    form: Form = Format.TEXT,
) -> None:
    """Replay a recording, with its timing, on a private router that no robot listens to.

    It happens on a router of its own; times inside communicates (sent, reply-by) are moved to now.
    With --replace one agent is real, the others are stood in from the recording, and where its
    words first differ from the recorded ones is said. With --verify every agent (or --agent's) runs
    its steps again from its log, offline, and must put out what it put out then, to the byte. Exits
    with 1 where something differs, or where agents live in the system.

    Examples:
      roco replay runs/latest --speed 4
      roco replay recording.mcap --loop --only channel=CHANNEL --only performative=inform-ref
      roco replay runs/latest --replace AGENT --speed max
      roco replay runs/latest --verify
    """
    fast = factor(speed)
    if verify_ and replace_:
        raise UsageError("--verify and --replace are two questions; ask one after the other")
    if verify_:
        verify.verified(file, agent or [], seed, form)
        return
    if replace_:
        replace.replaced(file, replace_, fast, seed, form)
        return
    chosen = narrowed(only or [], channel, agent, protocol, performative)
    samples = list(_meant(file, wanted(of_run(file).design, *chosen), telemetry=telemetry))
    if not samples:
        none = "holds nothing that is meant; choose more, or leave filters out"
        raise UsageError(f"{file} {none}")
    try:
        stage = Stage(system, connect)
        done = _played(of_run(file), samples, stage, fast, after, form, loop=loop)
    except RuntimeFault as error:
        raise ConsoleError(str(error)) from error
    tell(done, form, sentence(done))


def factor(speed: str) -> float | None:
    """Return the speed-up factor; None: as fast as possible. Raises UsageError."""
    if speed == "max":
        return None
    try:
        value = float(speed)
    except ValueError:
        value = 0.0
    if not 0 < value < float("inf"):
        raise UsageError(f"--speed {speed} is no speed; give a number above 0, or max")
    return value


def narrowed(only: list[str], *chosen: list[str] | None) -> list[list[str]]:
    """--only KIND=NAME put to the options of the kinds. Raises UsageError."""
    kinds = ("channel", "agent", "protocol", "performative")
    found = {kind: list(names or ()) for kind, names in zip(kinds, chosen, strict=True)}
    for text in only:
        kind, _, names = text.partition("=")
        if kind not in found or not names:
            raise UsageError(
                f"--only {text} is no filter; write KIND=NAME[,NAME] with a KIND of"
                f" {', '.join(kinds)}"
            )
        found[kind] += names.split(",")
    return [found[kind] for kind in kinds]


def _played(
    system: System,
    samples: list[Sample],
    stage: Stage,
    fast: float | None,
    after: float,
    form: Form,
    *,
    loop: bool,
) -> Replayed:
    shown = Shown(_folder(stage), system)
    player = Player(stage, samples, fast, shown.take)
    console = Console(stderr=True, quiet=form is Format.JSON)
    try:
        with _announced(stage, system), doing("replaying") as say:
            listen = f"to listen: roco traffic echo --run-dir {_folder(stage)}"
            where = f"system {stage.system} at {stage.endpoint}"
            console.print(f"{where}; {listen}", highlight=False, soft_wrap=True)
            player.wait(time.monotonic() + after)
            for _ in range(FOREVER if loop else 1):
                shown.begin()
                player.play(lambda text: say(f"replaying {text}"))
            player.wait(time.monotonic() + READ_S)
    except KeyboardInterrupt:
        pass
    finally:
        stage.close()
        shown.close()
    return player.done()


class Shown:
    """The replayed run as live.jsonl and step logs, from which `roco top` and the verbs about
    traffic are drawn.
    """

    def __init__(self, folder: Path, system: System) -> None:
        make_run(folder)
        self._folder, self._system, self._logs = folder, system, StepLogs(folder)
        self._file = (folder / LIVE_FILE).open("wb", buffering=0)
        self.begin()

    def begin(self) -> None:
        """Show everything once more: what is said again in a new round is not a copy."""
        from operate.judging.live import Live

        self._live = Live(self._system)

    def take(self, sample: Sample) -> None:
        """Write the lines of a sample."""
        from operate.recording.records import Spoken, understood

        record = understood(sample, self._system)
        with contextlib.suppress(OSError):  # the replay goes on without its picture
            if isinstance(record, Spoken):
                self._logs.passed(record.communicate, record.received)
            for line in self._live.lines(record):
                self._file.write(msgspec.json.encode(line) + b"\n")

    def close(self) -> None:
        """Leave nothing behind."""
        self._file.close()
        (self._folder / LIVE_FILE).unlink(missing_ok=True)
        shutil.rmtree(self._folder / STEPS, ignore_errors=True)
        with contextlib.suppress(OSError):
            self._folder.rmdir()


def _meant(file: Path, which: Filter, *, telemetry: bool) -> Iterator[Sample]:
    for sample in recorded(file, everything=telemetry):
        one = heard_message(sample) if sample is not None else None
        if sample is None or sample.token or sample.size:  # what nobody took has no content
            continue
        if which.keeps(one) if one is not None else _published(sample.key):
            yield sample


def _published(key: str) -> bool:
    """Whether it is what robot and agents publish; any other key, too, may have been put on."""
    chunks = key.split("/")
    return len(chunks) > KIND and chunks[KIND - 1] == HOUSE and chunks[KIND] in PUBLISHED


def _folder(stage: Stage) -> Path:
    return folders.RUNS / f"{stage.system}-{stage.endpoint.rsplit(':', 1)[-1]}"


@contextlib.contextmanager
def _announced(stage: Stage, system: System) -> Iterator[None]:
    """While it goes on, a folder says where, and of which system it is, so that `--run-dir` finds
    it.
    """
    folder = _folder(stage)
    make_run(folder)
    now = datetime.now().timestamp()
    fleet = Fleet(
        stage.system, stage.endpoint, 0, now, (), entry=system.entry, project=system.project
    )
    write_whole(folder / FLEET_FILE, msgspec.json.encode(fleet))
    try:
        yield
    finally:
        (folder / FLEET_FILE).unlink(missing_ok=True)
