"""An afternoon of twelve commands with one fleet, with four interruptions (three cancels, a stop)
and two more urgent tasks, while the page is open in browsers.

Each command has a verdict by the true world: what hangs in which hand, what stands, what was
poured. Nothing may be dropped meanwhile. It compares the time left, as told when a task begins,
with the time that the task took. Appends a line per seed to a results file and skips seeds that
stand there. The page needs Debian's Chromium.

    python benchmarks/afternoon.py --seeds 1-10
    python benchmarks/afternoon.py --seeds 1 --speed 1 --browsers 0
    python benchmarks/afternoon.py --table
"""

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Annotated, Any

import msgspec
import tables
import typer
from msgspec.structs import replace

from companion.design import LANGUAGES, AgentName
from companion.languages import cmd
from companion.run_files import SLOTS_FILE, TaskLine
from companion.skills.loop_messages import Mode
from companion.tools.system import SYSTEM
from companion.tools.verbs.hi import Hi, HiError, address
from console.errors import ConsoleError
from console.fleet import starting
from console.fleet.local import Local
from operate.file_names import TRAFFIC_FILE
from operate.recording import mcap_file
from operate.recording.records import Spoken
from services.executor.loop.link import AgentLink
from services.human_interface.memory import Memory
from velma.errors import SlotError
from velma.sim.truth import Truth

RESULTS = Path(__file__).parent / "results/afternoon.jsonl"
PAGE = Path(__file__).parents[1] / "docs/results/scheduling.md"
BEGIN, END = "<!-- afternoon: python benchmarks/afternoon.py --table -->\n", "<!-- /afternoon -->\n"
RUN = tables.commit()
CHROMIUM = "/usr/bin/chromium"
Verdict = Callable[[Truth], str]
"""Why the true world is not as wanted; "" where it is."""
ENDED = ("done", "failed", "cancelled", "refused")
# wall; estimates for a busy machine: the start; a task; a release; a reading; between two looks
UP_S, TASK_S, RELEASE_S, READ_S, PERIOD_S = 180.0, 600.0, 60.0, 20.0, 0.02
STOOD_S = 0.5  # [s] wall, that a stopped robot is left alone (estimate)
LOWEST_M = {"jar_1": 0.80, "bowl_1": 0.72}
"""Origins of things that stand on the lowest surface there is, the table of 0.775 m, less some
centimetres.
"""
LIES_DEG, UPRIGHT_DEG, HELD_DEG, HELD = 60.0, 10.0, 20.0, 3
"""Of what was dropped; of what stands; of what is held, and on how many links (estimates)."""

NEAR = 0.25
"""Share of the real time by which the time left may be wrong (wanted)."""


class NotSeenError(Exception):
    """Something did not come in its time."""


class Command(msgspec.Struct, frozen=True):
    """A sentence, how its task may end, and what is true then. `at`: the act during which something
    happens; `then`: cancel, stop (and release), or another sentence, said as a more urgent one.
    """

    say: str
    verdict: Verdict
    ends: tuple[str, ...] = ("done",)
    at: str = ""
    then: str = ""


def free(truth: Truth) -> str:
    """Everything stands upright, in no hand."""
    tilted = (f"{name} is tilted" for name, by in truth.tilt_deg.items() if by > UPRIGHT_DEG)
    held = (f"{name} is touched" for name, on in truth.fingers_on.items() if any(on.values()))
    return ", ".join((*tilted, *held))


def hangs(name: str) -> Verdict:
    """It hangs upright in a hand."""

    def verdict(truth: Truth) -> str:
        held = max(truth.fingers_on[name].values(), default=0) >= HELD
        return "" if held and truth.tilt_deg[name] < HELD_DEG else f"{name} is not held upright"

    return verdict


def poured(truth: Truth) -> str:
    """Nine tenths of the content are in the bowl."""
    share = truth.grains_in["bowl_1"] / truth.grains
    return "" if share >= 0.9 else f"{share:.0%} is in the bowl"


def anything(truth: Truth) -> str:
    """Whatever is."""
    return ""


POUR = "pour the jar into the bowl"
AFTERNOON = (
    Command("look around", free),
    Command(POUR, free, ("cancelled",), "carry jar_1", "cancel"),
    Command("bring me the jar", hangs("jar_1")),
    Command("swap hands", hangs("jar_1")),
    Command("put it down", free),
    Command("take the bowl", hangs("bowl_1"), ("done",), "take bowl_1", "look around"),
    Command("put down the bowl", free, ("cancelled", "done"), "release", "cancel"),
    Command("bring me the jar", anything, ("failed",), "take jar_1", "stop"),
    Command("look around", anything),
    Command(POUR, free, ("cancelled",), "move-joint", "cancel"),
    Command(POUR, poured, ("done",), "move-joint", "look around"),
    Command("put down the jar", free),
)


class Afternoon:
    """A fleet in a folder of its own; up on entry, down on exit. `dropped`: the first thing that
    was.
    """

    def __init__(self, run: Path, seed: int, speed: str) -> None:
        self.run, self.dropped = run, ""
        self._words = ["up", "--out", str(run), "--speed", speed, "--seed", str(seed)]
        self._link: AgentLink | None = None

    def __enter__(self) -> "Afternoon":
        roco = Path(sys.executable).with_name("roco")
        subprocess.run([str(roco), *self._words], check=True, capture_output=True, timeout=UP_S)
        self.wait(lambda: self.hi.tasks() is not None, "the human interface", UP_S)
        return self

    def __exit__(self, *_: object) -> None:
        starting.down(self.run)

    @property
    def hi(self) -> Hi:
        """The human interface where it listens now."""
        return Hi(address(Local(self.run)))

    def line(self, task: str) -> TaskLine:
        """A task as it stands."""
        return next(line for line in self.hi.tasks() if line.task == task)

    def ended(self, task: str) -> TaskLine:
        """A task once it has ended."""
        self.wait(lambda: self.line(task).state in ENDED, f"the end of {task}", TASK_S)
        return self.line(task)

    def wait(self, condition: Callable[[], object], what: str, within_s: float) -> None:
        """Wait, and watch that nothing falls. Raise NotSeenError."""
        until = time.monotonic() + within_s
        while True:
            with suppress(HiError, ConsoleError):
                if condition():
                    return
            if time.monotonic() > until:
                raise NotSeenError(f"{what} did not come within {within_s:g} s")
            with suppress(NotSeenError):
                self.dropped = self.dropped or dropped(self.truth(0.0))
            time.sleep(PERIOD_S)

    def truth(self, within_s: float = READ_S) -> Truth:
        """The true world, which no agent sees. Raise NotSeenError."""
        until = time.monotonic() + within_s
        while True:
            with suppress(SlotError, OSError):
                if sealed := self.link().sealed_truth():  # empty before the first one
                    return msgspec.msgpack.decode(sealed, type=Truth)
            if time.monotonic() > until:
                raise NotSeenError("the loop says nothing")
            time.sleep(PERIOD_S)

    def link(self) -> AgentLink:
        """The loop's memory; that of another loop once it was replaced."""
        if self._link is None or self._link.file.replaced:
            self._link = AgentLink(self.run / SLOTS_FILE)
        return self._link

    def do(self, command: Command) -> dict[str, Any]:
        """Carry a command out; `wrong`: why it did not go as wanted."""
        began, task = time.monotonic(), self.hi.say(command.say).task
        wrong = other = ""
        if command.at:
            self.wait(lambda: self._there(task, command.at), command.at, TASK_S)
            if self.line(task).state in ENDED:
                wrong = f"it ended before {command.at}"
            else:
                other = self._interrupt(task, command.then)
        line = self.ended(task)
        if line.state not in command.ends:
            wrong = f"{line.state}: {line.text}"
        wrong = wrong or other or command.verdict(self.truth())
        lasted = round(time.monotonic() - began, 1)
        return {"say": command.say, "state": line.state, "wrong": wrong, "wall_s": lasted}

    def _there(self, task: str, act: str) -> bool:
        line = self.line(task)
        return line.state in ENDED or (line.at is not None and act in line.at.path)

    def _interrupt(self, task: str, how: str) -> str:
        """Interrupt a task; why the other one did not go as wanted, if there is another."""
        if how == "cancel":
            self.hi.cancel(task)
        elif how == "stop":
            self.hi.hold(True)
            self.ended(task)
            time.sleep(STOOD_S)
            self.hi.hold(False)
            self.wait(self._moves, "the release", RELEASE_S)
        else:
            line = self.ended(self.hi.say(how, 1).task)
            return "" if line.state == "done" else f"{how}: {line.state}: {line.text}"
        return ""

    def _moves(self) -> bool:
        with suppress(SlotError, OSError):
            state = self.link().state()
            return state is not None and state.mode is Mode.MOTION
        return False


def dropped(truth: Truth) -> str:
    """What falls, or lies where no hand has it; "" for nothing."""
    for name, (_, _, z) in truth.at.items():
        if any(truth.fingers_on.get(name, {}).values()):
            continue
        if z < LOWEST_M.get(name, 0.0) or truth.tilt_deg.get(name, 0.0) > LIES_DEG:
            return f"{name} is {z:.2f} m high, tilted by {truth.tilt_deg.get(name, 0.0):.0f} deg"
    return ""


def look(run: Path) -> None:
    """Have the page of a fleet open in a browser until this process is ended. An error of the page
    ends it at once.
    """
    from playwright.sync_api import sync_playwright

    roco = Path(sys.executable).with_name("roco")
    words = [str(roco), "page", "--run-dir", str(run)]
    door = subprocess.run(words, check=True, capture_output=True, text=True, timeout=UP_S)
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, chromium_sandbox=False)
        page = browser.new_page()
        page.on("pageerror", lambda error: os._exit(1))
        page.set_default_timeout(TASK_S * 1000)
        page.goto(door.stdout.strip())
        page.locator("#now", has_text="Velma").wait_for()
        page.wait_for_event("close", timeout=0)


def foretold(run: Path) -> list[tuple[str, float, float]]:
    """Each task that was done, the time left that people were told when it began [s], and the time
    that it took from then on [s], from the recorded reports.
    """
    memory, wishes = Memory(), dict[str, str]()
    began: dict[str, tuple[float, float]] = {}
    found: list[tuple[str, float, float]] = []
    for one in mcap_file.read(run / TRAFFIC_FILE, SYSTEM).records:
        said = one.communicate if isinstance(one, Spoken) and not one.lost else None
        if said is None or {said.sender, said.receiver} != {AgentName.CO, AgentName.HI}:
            continue
        content, talk, now = LANGUAGES.read(said)[0], said.conversation, one.received
        if isinstance(content, cmd.Command):
            wishes[talk] = type(content).__name__
        if not isinstance(content, cmd.TaskReport):
            continue
        state = content.state
        line = memory.task(talk) or TaskLine(talk, state, "", "", now)
        memory = memory.timed(replace(line, state=state), content, now)
        told = memory.task(talk)
        until = told.until if told else 0.0
        if state is cmd.TaskState.RUNNING and content.rest and until > now:
            began.setdefault(talk, (now, until))
        if state is cmd.TaskState.DONE and talk in began:
            begin, end = began[talk]
            found.append((wishes.get(talk, ""), round(end - begin, 1), round(now - begin, 1)))
    return found


def measured(seed: int, speed: str, browsers: int, run: Path) -> dict[str, Any]:
    """One afternoon, as a line of the results file. `seen`: the browsers that were open to the
    end.
    """
    line: dict[str, Any] = {"seed": seed, "speed": speed, "commit": RUN, "commands": []}
    line["load"], began = round(os.getloadavg()[0], 1), time.monotonic()
    try:
        with Afternoon(run, seed, speed) as fleet, ExitStack() as stack:
            shown = [
                stack.enter_context(subprocess.Popen([sys.executable, __file__, "--show", run]))
                for _ in range(browsers)
            ]
            for one in shown:
                stack.callback(one.terminate)
            for command in AFTERNOON:
                line["commands"].append(found := fleet.do(command))
                typer.echo(f"  {found['say']}: {found['state']} {found['wrong']}")
                if found["wrong"]:
                    break
            line |= {"dropped": fleet.dropped, "sim_s": round(fleet.truth().time_s)}
            line["seen"] = sum(one.poll() is None for one in shown)
    except (NotSeenError, HiError, ConsoleError, OSError, subprocess.SubprocessError) as error:
        line["failure"] = str(error)[:300]
    line["wall_s"] = round(time.monotonic() - began, 1)
    with suppress(OSError):
        line["left"] = foretold(run)
    return line | {"good": not why(line) and line["seen"] == browsers}


def why(line: dict[str, Any]) -> str:
    """The first thing that was not as wanted in an afternoon; "" for nothing."""
    wrong = (f"“{one['say']}”: {one['wrong']}" for one in line["commands"] if one["wrong"])
    return next(wrong, line.get("failure", "") or line.get("dropped", ""))


def printed() -> str:
    """The table of all afternoons."""
    rows = ["| speed | seeds | as wanted | nothing dropped | time left | load | not as wanted |\n"]
    rows.append("|---|---|---|---|---|---|---|\n")
    lines = tables.read(RESULTS)
    for speed in sorted({line["speed"] for line in lines}):
        some = [line for line in lines if line["speed"] == speed]
        good, kept = sum(one["good"] for one in some), sum(not one.get("dropped") for one in some)
        loads = [one["load"] for one in some]
        wrong = "; ".join(f"seed {one['seed']}: {why(one)}" for one in some if not one["good"])
        span = f"{min(loads):.0f} to {max(loads):.0f}"
        left = [one for line in some for one in line.get("left", ())]
        near = sum(abs(said - took) <= NEAR * took for _, said, took in left)
        told = f"{near} of {len(left)}"
        rows.append(f"| {speed} | {len(some)} | {good} | {kept} | {told} | {span} | {wrong} |\n")
    return "".join(rows)


def main(
    seeds: Annotated[str, typer.Option(help="first-last, or one")] = "1-10",
    out: Annotated[Path, typer.Option(help="results file, JSON lines")] = RESULTS,
    speed: Annotated[str, typer.Option(help="of the fleet: max or 1")] = "max",
    browsers: Annotated[int, typer.Option(help="browsers that have the page open")] = 2,
    table: Annotated[
        bool, typer.Option("--table", help="write docs/results/scheduling.md, and end")
    ] = False,
    show: Annotated[Path | None, typer.Option(hidden=True)] = None,
) -> None:
    """Run the seeds that do not stand in the results file yet."""
    if show is not None:
        look(show)
        return
    if table:
        tables.put(PAGE, BEGIN, printed(), END)
        return
    known = {(line["seed"], line["speed"]) for line in tables.read(out)}
    base = Path(tempfile.mkdtemp(prefix="afternoon-"))
    for seed in tables.seeds(seeds):
        if (seed, speed) in known:
            continue
        line = measured(seed, speed, browsers, base / f"seed-{seed}")
        tables.append(out, line)
        told = "good" if line["good"] else f"FAILED: {why(line)}"
        typer.echo(f"seed {seed}: {told}, {line['wall_s']} s, load {line['load']}")


if __name__ == "__main__":
    typer.run(main)
