"""`roco replay FILE --replace AGENT`: a real agent, as in the fleet, against the others as recorded.

The others are played by agent_runtime.testing.stand_in: each says what was recorded, once the agent has said all
that it had said before. Compared is what the agent says: performative, receiver, protocol, language, content, what it
answers.
"""

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import msgspec
import typer

from agent_runtime.core.binding import wiring
from agent_runtime.testing.stand_in import Cast, Stage
from fipa_codec.communicate import Communicate
from fipa_codec.languages import Languages
from operate.cli.errors import ConsoleError, UsageError
from operate.cli.output import Form, Format, tell_json
from operate.cli.terminal.console import Console
from operate.cli.traffic.listen import HOUSE, recorded, said
from operate.cli.traffic.play import moved
from operate.cli.traffic.script import Difference, Part, Script, before, parts, plain, short
from operate.system import System, of_run

SYSTEM = "replay"
SETTING = "setting"
"""Under this kind a recording holds what its fleet was started with."""
READY_S = 60.0
"""Until the agent is ready; estimate: seconds on a busy machine."""
PATIENCE_S = 20.0
"""Time to wait for a line beyond its recorded time [s]; estimate: a plan on a busy machine."""
SLICE_S = 0.005
END_S = 0.5
"""At the end it is listened so long for words that the recording does not have."""


class Compared(msgspec.Struct, frozen=True):
    """Result for the real agent: lines of the recording, lines it spoke, first difference (None: none)."""

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
    console = Console(stderr=True, quiet=form is Format.JSON)
    with console.status(f"starting {agent}") as line, _running(system, agent, module, seed) as cast:
        script, begun = Script(part), time.monotonic()
        found = _play(script, cast, part, fast, lambda n: line.update(f"{agent} speaks: {n} of {len(part)} entries"))
    done = _compared(agent, part, script, found, time.monotonic() - begun)
    if form is Format.JSON:
        tell_json(done)
    else:
        print(sentence(done, part))
    if found is not None:
        raise typer.Exit(1)


def _module(system: System, agent: str) -> str:
    """The module of an agent that can be run alone. Raises UsageError."""
    there = [one for one in system.processes if one.name in system.design.agents and one.name not in system.unreplaced]
    can = ", ".join(sorted(one.name for one in there))
    if agent in system.unreplaced:
        raise UsageError(f"{agent} cannot be replaced: {system.unreplaced[agent]}; {can} can")
    for one in there:
        if one.name == agent:
            return one.module
    raise UsageError(f"the design has no agent {agent!r}; {can} can be replaced")


def sentence(done: Compared, part: tuple[Part, ...]) -> str:
    """Return the result in words for people."""
    spoken = f"{done.agent} spoke {done.spoken} of {done.lines} recorded lines, after {done.cues} cues"
    if done.difference is None:
        return f"{spoken}, all of them as recorded, in {done.seconds:.1f} s"
    one = done.difference
    when = f"entry {one.line}, {part[one.line - 1].at - part[0].at:+.2f} s" if one.line else "beyond the recording"
    what = f"{done.agent} > {done.receiver} {done.performative}" if done.performative else done.agent
    return (
        f"{spoken}; then its words differ\n  {when}  {what}  {done.conversation}\n  in {one.field}\n"
        f"  recorded: {short(one.recorded)}\n  now:      {short(one.now)}"
    )


def _part(file: Path, agent: str) -> tuple[tuple[Part, ...], int]:
    """The agent's part, of its first recorded life; the seed of the run. Raises UsageError."""
    heard, seed, lives = [], 1, set()
    for sample in recorded(file, everything=True):
        if sample is None or not sample.key:
            continue
        if sample.key.split("/")[2:4] == [HOUSE, SETTING]:
            seed = _seed(sample.data)
        if sample.token and sample.key.split("/")[-2] == agent and not sample.gone:
            lives.add(sample.key)
            if len(lives) > 1:
                break
        one = said(sample)
        communicate = one.communicate() if one is not None else None
        if communicate is not None:
            heard.append((sample.at, communicate))
    part = parts(agent, heard)
    if not any(one.mine for one in part):
        raise UsageError(f"{file} has nothing that {agent} said; give a recording without filters")
    earlier = before(part)
    if earlier is not None:
        words = earlier.communicate
        raise UsageError(
            f"{file} begins in the middle of {agent}'s life ({words.sender} > {words.receiver} {words.performative} of"
            f" {words.conversation} goes on with what is not in it); give one from the start of the fleet"
        )
    return part, seed


def _seed(setting: bytes) -> int:
    try:
        return int(msgspec.json.decode(setting).get("seed", 1))
    except (msgspec.DecodeError, AttributeError, ValueError):
        return 1


class _Stop(msgspec.Struct, frozen=True):
    """Place where it ended: the difference, and the real words, if there were any."""

    difference: Difference
    words: Communicate | None


def _play(
    script: Script, cast: Cast, part: tuple[Part, ...], fast: float | None, look: Callable[[int], None]
) -> _Stop | None:
    """Until all is spoken (None), or something differs."""
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
                return _Stop(found, heard)
        elif line is not None and now - moved_on > PATIENCE_S + _pause(part, line) / (fast or 1.0):
            return _Stop(Difference(line.n, "words", plain(line.communicate), None), None)
    extra = cast.hear(END_S)
    return None if extra is None else _Stop(Difference(0, "words", None, plain(extra)), extra)


def _pause(part: tuple[Part, ...], line: Part) -> float:
    """Return the recorded pause before the line [s]."""
    return line.at - part[line.n - 2].at if line.n > 1 else 0.0


def _compared(agent: str, part: tuple[Part, ...], script: Script, found: _Stop | None, seconds: float) -> Compared:
    cues = sum(not one.mine for one in part[: script.given_cues])
    done = Compared(agent, sum(one.mine for one in part), len(script.spoken), cues, round(seconds, 3), None)
    if found is None:
        return done
    one = found.words or part[found.difference.line - 1].communicate
    told = {"conversation": one.conversation, "performative": str(one.performative), "receiver": one.receiver}
    return msgspec.structs.replace(done, difference=found.difference, **told)


@contextmanager
def _running(system: System, agent: str, module: str, seed: int) -> Iterator[Cast]:
    """The agent as a process with a router of its own, ready, and its peers. Raises ConsoleError."""
    stage = Stage(SYSTEM)
    with tempfile.TemporaryDirectory(prefix="roco-replay-") as folder:
        run = Path(folder)
        links = wiring(agent, SYSTEM, design=system.design, languages=system.languages or Languages())
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
    system: System, agent: str, module: str, run: Path, router: str, agents: dict[str, str], seed: int
) -> "subprocess.Popen[bytes]":
    told = {
        "CONNECT": router,
        "AGENTS": ",".join(f"{name}={endpoint}" for name, endpoint in agents.items()),
        "LISTEN": "",
        "RUN_DIR": str(run),
        "SYSTEM": SYSTEM,
        "SEED": str(seed),
        "LOG_LEVEL": "error",
        "TLS_DIR": "",
    }
    environment = os.environ | system.environment(run) | {f"ROCO_{name}": value for name, value in told.items()}
    with (run / f"{agent}.log").open("wb") as log:
        process = subprocess.Popen([sys.executable, "-P", "-m", module], env=environment, stdout=log, stderr=log)
    until = time.monotonic() + READY_S
    while not (run / f"{agent}.ready").exists():
        if process.poll() is not None or time.monotonic() > until:
            process.kill()
            process.wait()
            words = (run / f"{agent}.log").read_text(errors="replace").strip().splitlines()[-1:] or ["it says nothing"]
            raise ConsoleError(f"{agent} did not become ready in {READY_S:.0f} s: {words[0]}")
        time.sleep(SLICE_S)
    return process
