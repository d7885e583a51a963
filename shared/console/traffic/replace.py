"""`roco replay FILE --replace AGENT`: a real agent, as in the fleet, against the others as
recorded.

The others are played by agent_runtime.impersonation: each says what was recorded, once the agent
has said all that it had said before. Compared is what the agent says: performative, receiver,
protocol, language, content, what it answers.
"""

import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import msgspec
import typer

from agent_runtime.core.binding import wiring
from agent_runtime.impersonation import Cast, Stage
from console.errors import ConsoleError, UsageError, last_line
from console.output import Form, tell
from console.traffic.play import as_agent, compared, difference, moved
from fipa_codec.communicate import Communicate
from fipa_codec.languages import Languages
from operate.doing import doing
from operate.system import System, of_run

# --- One agent's part of a recording, and whether a real agent speaks it: its lines and its cues,
# in the order recorded A cue is what another agent says to it; it is given once all lines before it
# are spoken. A line is what the agent says. Ids and conversations that the real agent names
# otherwise are told apart by their place. Pure: no clock, no wire.


COMPARED = ("performative", "receiver", "protocol", "language", "ontology", "in_reply_to")


class Part(msgspec.Struct, frozen=True):
    """One entry, recorded at `at` [unix s]; `n` counts from 1. `mine`: a line of the agent; else a
    cue.
    """

    n: int
    at: float
    communicate: Communicate
    mine: bool


class Difference(msgspec.Struct, frozen=True):
    """First difference of the words: the field, its recorded value, its present value; None:
    nothing.

    `line`: which entry of the part, 0 where the recording has none.
    """

    line: int
    field: str
    recorded: Any
    now: Any


def parts(agent: str, heard: Iterable[tuple[float, Communicate]]) -> tuple[Part, ...]:
    """The part of an agent in a recording, copies left out."""
    known: set[tuple[str, str, str]] = set()
    found: list[Part] = []
    for at, one in heard:
        name = (one.sender, one.receiver, one.id)
        if agent in (one.sender, one.receiver) and name not in known:
            known.add(name)
            found.append(Part(len(found) + 1, at, one, one.sender == agent))
    return tuple(found)


def before(part: tuple[Part, ...]) -> Part | None:
    """The first entry that shows that the agent had lived before the recording began; None where
    nothing does.

    It answers what is not in the recording, or a stream begins with another number than 1.
    """
    said: set[tuple[str, str]] = set()
    streams: set[tuple[str, str]] = set()
    for one in part:
        words = one.communicate
        if words.in_reply_to and (words.conversation, words.in_reply_to) not in said:
            return one
        if words.id.isdigit() and (words.sender, words.receiver) not in streams and words.id != "1":
            return one
        said.add((words.conversation, words.reply_with))
        streams |= {(words.sender, words.receiver)} if words.id.isdigit() else set()
    return None


class Script:
    """Progress of the script: `spoken` lines of the part, in any order; `at`: up to which entry all
    cues are given; names that the real agent chose differently.
    """

    def __init__(self, part: tuple[Part, ...]) -> None:
        self._part, self.at = part, 0
        self.spoken: set[int] = set()
        self._first: dict[str, Part] = {}
        for one in part:
            self._first.setdefault(one.communicate.conversation, one)
        self._recorded: dict[str, str] = {}
        self._real: dict[str, str] = {}
        self._labels: dict[tuple[str, str], str] = {}
        self._given: dict[tuple[str, str], str] = {}

    def cue(self) -> Part | None:
        """The next cue; None where there is none."""
        return next((one for one in self._part[self.at :] if not one.mine), None)

    def awaited(self) -> Part | None:
        """The first line before the next cue (or the end) that is not spoken yet."""
        cue = self.cue()
        lines = (one for one in self._part[: cue.n - 1 if cue else None] if one.mine)
        return next((one for one in lines if one.n not in self.spoken), None)

    def adapted(self, cue: Part) -> Communicate:
        """A cue with the names the real agent gave: its conversation, and what it answers."""
        one = cue.communicate
        answers = self._labels.get((one.conversation, one.in_reply_to), one.in_reply_to)
        talk = self._real.get(one.conversation, one.conversation)
        return msgspec.structs.replace(one, conversation=talk, in_reply_to=answers)

    def given(self, cue: Part, said: Communicate) -> None:
        """The cue was said, with these names."""
        self.at = cue.n
        if said.reply_with:
            self._given[said.sender, said.reply_with] = cue.communicate.reply_with

    def hear(self, one: Communicate) -> Difference | None:
        """The real agent said this: None where it is what was recorded, else where it differs."""
        line = self._line(one)
        if line is None:
            return Difference(0, "words", None, plain(one))
        self.spoken.add(line.n)
        was = line.communicate
        self._recorded[one.conversation] = was.conversation
        self._real[was.conversation] = one.conversation
        if one.reply_with:
            self._labels[was.conversation, was.reply_with] = one.reply_with
        answers = self._given.get((one.receiver, one.in_reply_to), one.in_reply_to)
        now = msgspec.structs.replace(one, in_reply_to=answers)
        found = difference(plain(was), plain(now))
        return None if found is None else Difference(line.n, *found)

    def _line(self, one: Communicate) -> Part | None:
        """The line it must be: the next of its conversation, else the next that opens one with that
        agent.
        """
        unspoken = (part for part in self._part if part.mine and part.n not in self.spoken)
        mine = [part for part in unspoken if part.communicate.receiver == one.receiver]
        talk = one.conversation
        known = self._recorded.get(talk)
        first = self._first.get(talk)
        if known is None and first is not None and not first.mine:
            known = talk
        for part in mine:
            was = part.communicate
            opens = self._first[was.conversation] is part and was.protocol == one.protocol
            if was.conversation == known if known is not None else opens:
                return part
        return None


def plain(one: Communicate) -> dict[str, Any]:
    """Return the compared part of a communicate: all but its names and times."""
    told: dict[str, Any] = {name: str(value) for name in COMPARED if (value := getattr(one, name))}
    told["reply_by"] = one.reply_by is not None
    if one.content is not msgspec.UNSET:
        told["content"] = msgspec.msgpack.decode(one.content)
    return told


# --- `roco replay FILE --replace AGENT` -----------------------------------------------------------


SYSTEM = "replay"
READY_S = 60.0
"""Until the agent is ready; estimate: seconds on a busy machine."""
PATIENCE_S = 20.0
"""Time to wait for a line beyond its recorded time [s]; estimate: a plan on a busy machine."""
SLICE_S = 0.005
END_S = 0.5
"""At the end it is listened so long for words that the recording does not have."""


class Compared(msgspec.Struct, frozen=True):
    """Result for the real agent: lines of the recording, lines it spoke, first difference (None:
    none).
    """

    agent: str
    lines: int
    spoken: int
    cues: int
    seconds: float
    difference: Difference | None
    conversation: str = ""
    performative: str = ""
    receiver: str = ""


def replaced(file: Path, agent: str, fast: float | None, seed: int | None, form: Form) -> None:
    """Do it and tell how it went. Exits with 1 where the words differ. Raises ConsoleError."""
    system = of_run(file)
    module = _module(system, agent)
    part, recorded_seed = _part(file, agent)
    seed = recorded_seed if seed is None else seed
    with doing(f"starting {agent}") as say, _running(system, agent, module, seed) as cast:
        script, begun, of = Script(part), time.monotonic(), len(part)

        def look(spoken: int) -> None:
            say(f"{agent} speaks: {spoken} of {of} entries")

        found = _play(script, cast, part, fast, look)
    difference, words = found or (None, None)
    done = Compared(
        agent=agent,
        lines=sum(one.mine for one in part),
        spoken=len(script.spoken),
        cues=sum(not one.mine for one in part[: script.at]),
        seconds=round(time.monotonic() - begun, 3),
        difference=difference,
        conversation=words.conversation if words else "",
        performative=str(words.performative) if words else "",
        receiver=words.receiver if words else "",
    )
    tell(done, form, sentence(done, part))
    if found is not None:
        raise typer.Exit(1)


def _module(system: System, agent: str) -> str:
    """The module of an agent that can be run alone. Raises UsageError."""
    alone = system.design.agents.keys() - system.unreplaced.keys()
    modules = {one.name: one.module for one in system.processes if one.name in alone}
    can = ", ".join(sorted(modules))
    if agent in system.unreplaced:
        raise UsageError(f"{agent} cannot be replaced: {system.unreplaced[agent]}; {can} can")
    if agent not in modules:
        raise UsageError(f"the design has no agent {agent!r}; {can} can be replaced")
    return modules[agent]


def sentence(done: Compared, part: tuple[Part, ...]) -> str:
    """Return the result in words for people."""
    agent, one, when = done.agent, done.difference, "beyond the recording"
    spoken = f"{agent} spoke {done.spoken} of {done.lines} recorded lines, after {done.cues} cues"
    if one is None:
        return f"{spoken}, all of them as recorded, in {done.seconds:.1f} s"
    if one.line:
        when = f"entry {one.line}, {part[one.line - 1].at - part[0].at:+.2f} s"
    what = f"{agent} > {done.receiver} {done.performative}" if done.performative else agent
    return (
        f"{spoken}; then its words differ\n  {when}  {what}  {done.conversation}\n  in"
        f" {one.field}\n{compared(one.recorded, one.now)}"
    )


def _part(file: Path, agent: str) -> tuple[tuple[Part, ...], int]:
    """The agent's part, of its first recorded life; the seed of the run. Raises UsageError."""
    from operate.recording.records import Token, communicate_in, setting_in
    from operate.recording.run import opened

    heard, seed, lives = [], 1, set()
    for record in opened(file).records:
        if (setting := setting_in(record)) is not None:
            seed = setting.seed
        elif isinstance(record, Token) and record.agent == agent and record.alive:
            lives.add((record.incarnation, record.journal))
            if len(lives) > 1:
                break
        elif (communicate := communicate_in(record)) is not None:
            heard.append((record.received, communicate))
    part = parts(agent, heard)
    if not any(one.mine for one in part):
        raise UsageError(f"{file} has nothing that {agent} said; give a recording without filters")
    earlier = before(part)
    if earlier is not None:
        words = earlier.communicate
        raise UsageError(
            f"{file} begins in the middle of {agent}'s life ({words.sender} > {words.receiver}"
            f" {words.performative} of {words.conversation} goes on with what is not in it); give"
            " one from the start of the fleet"
        )
    return part, seed


def _play(
    script: Script,
    cast: Cast,
    part: tuple[Part, ...],
    fast: float | None,
    look: Callable[[int], None],
) -> tuple[Difference, Communicate] | None:
    """Until all is spoken (None), or something differs: in what, of which words."""
    begun = moved_on = time.monotonic()
    while True:
        line, cue, now = script.awaited(), script.cue(), time.monotonic()
        if line is None and cue is None:
            break
        due = begun + (cue.at - part[0].at) / fast if cue is not None and fast else 0.0
        if line is None and cue is not None and now >= due:
            script.given(cue, cast.say(moved(script.adapted(cue), cue.at, time.time(), fast)))
            moved_on = now
        heard = cast.hear(SLICE_S)
        if heard is not None:
            moved_on, found = now, script.hear(heard)
            look(len(script.spoken))
            if found is not None:
                return found, heard
        elif line is not None:
            pause = line.at - part[line.n - 2].at if line.n > 1 else 0.0
            if now - moved_on > PATIENCE_S + pause / (fast or 1.0):
                return Difference(line.n, "words", plain(line.communicate), None), line.communicate
    extra = cast.hear(END_S)
    return None if extra is None else (Difference(0, "words", None, plain(extra)), extra)


@contextmanager
def _running(system: System, agent: str, module: str, seed: int) -> Iterator[Cast]:
    """The agent as a process with a router of its own, ready, and its peers. Raises
    ConsoleError.
    """
    stage = Stage(SYSTEM)
    with tempfile.TemporaryDirectory(prefix="roco-replay-") as folder:
        run = Path(folder)
        languages = system.languages or Languages()
        links = wiring(agent, SYSTEM, design=system.design, languages=languages)
        process, cast = None, Cast(links, stage.endpoint)
        try:
            process = _started(system, agent, module, run, stage.endpoint, cast.agents, seed)
            yield cast
        finally:
            if process is not None:
                process.kill()
                process.wait()
            cast.close()
            stage.close()


def _started(
    system: System,
    agent: str,
    module: str,
    run: Path,
    router: str,
    agents: dict[str, str],
    seed: int,
) -> "subprocess.Popen[bytes]":
    listen = ",".join(f"{name}={endpoint}" for name, endpoint in agents.items())
    settings = {"CONNECT": router, "AGENTS": listen, "LISTEN": "", "RUN_DIR": str(run)}
    settings |= {"SYSTEM": SYSTEM, "SEED": str(seed)}
    environment, command = as_agent(system, run, settings), [sys.executable, "-P", "-m", module]
    with (run / f"{agent}.log").open("wb") as log:
        process = subprocess.Popen(command, env=environment, stdout=log, stderr=log)
    until = time.monotonic() + READY_S
    while not (run / f"{agent}.ready").exists():
        if process.poll() is not None or time.monotonic() > until:
            process.kill()
            process.wait()
            why = last_line((run / f"{agent}.log").read_bytes()) or "it says nothing"
            raise ConsoleError(f"{agent} did not become ready in {READY_S:.0f} s: {why}")
        time.sleep(SLICE_S)
    return process
