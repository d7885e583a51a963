"""The devices of ex: the skill process, the control loop, and both as one."""

import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from queue import Empty
from typing import Any

import numpy as np
from msgspec.structs import replace

from agent_runtime.io.devices import Device, Post
from agent_runtime.io.inbox import OneReaderQueue
from agent_runtime.io.worker import Worker
from companion.eyes import Eyes
from companion.languages.facts import Facts, Kind, fact
from companion.skills.loop_messages import FAULT, Cancel, LookAgain, Mode, Phase, Release
from services.executor.device_messages import (
    Brake,
    ByRays,
    Crashed,
    Do,
    Drop,
    Feel,
    FromSkill,
    Glance,
    GoOn,
    Halt,
    Lost,
    Moved,
    Passing,
    Perform,
    Setup,
    Stands,
    ToLoop,
    Where,
)
from services.executor.loop.link import AgentLink, LoopAnswer, LoopCommand, LoopState, reopened
from services.executor.memory import Felt
from services.executor.renderer import Renderer, See
from services.executor.telemetry import Telemetry
from velma.errors import SlotError
from velma.names import SIDES

# --- The skill process: started for an act, ended a minute after the last one. Drop kills it ------

ENTRY = "services.executor.skill_process:serve"
REST_S = 60.0
"""Without an act, until the process is ended; estimate: a plan has its acts one after the other."""


class SkillDevice:
    """Busy from a message to the child until its answer. `renderer`: looks for eyes by pixels."""

    def __init__(self, post: Post, setup: Setup, renderer: Renderer) -> None:
        self._post, self._setup, self._renderer = post, setup, renderer
        self._busy = self._acting = False
        self._child: Worker | None = None
        self._lock, self._rest = threading.Lock(), threading.Timer(0.0, lambda: None)

    @property
    def busy(self) -> bool:
        """Whether the child computes."""
        return self._busy

    @property
    def pid(self) -> int:
        """The child's process; 0: none runs."""
        child = self._child
        return child.pid if child is not None and child.alive else 0

    def tell(self, content: Perform | Feel | Glance | Drop) -> None:
        """Hand a message to the child; Drop kills a child in the middle of an act."""
        with self._lock:
            self._rest.cancel()
            if self._child is not None and (
                not self._child.alive or (self._acting and not isinstance(content, Feel | Glance))
            ):
                self._end()
            if not isinstance(content, Drop):
                if self._child is None:
                    self._child = self._new()
                if self._setup.eyes is Eyes.PIXELS and isinstance(content, Perform):
                    self._renderer.start()
                self._acting = self._busy = True
                self._child.tell(content)
            else:
                self._rest_later()

    def close(self) -> None:
        """Kill both processes."""
        with self._lock:
            self._rest.cancel()
            self._end()
        self._renderer.close()

    def _new(self) -> Worker:
        child = Worker(
            ENTRY,
            answers=FromSkill,
            on_message=lambda word: self._heard(child, word),
            on_end=self._over,
        )
        child.tell(self._setup)
        return child

    def _end(self) -> None:
        if self._child is not None:
            self._child.kill()
        self._child, self._acting, self._busy = None, False, False

    def _rest_later(self) -> None:
        self._rest = threading.Timer(REST_S, self._rested)
        self._rest.daemon = True
        self._rest.start()

    def _rested(self) -> None:
        with self._lock:
            if not self._acting and threading.current_thread() is self._rest:
                self._end()

    def _heard(self, child: Worker, word: FromSkill) -> None:
        if isinstance(word, See):
            self._renderer.look(word, child.tell)
            return
        if isinstance(word, ByRays):  # the act goes on; a child that follows does not try again
            self._setup = replace(self._setup, eyes=Eyes.RAYS)
            self._post(word)
            return
        self._acting = not hasattr(word, "outcome")
        if not self._acting:
            self._rest_later()
        self._post(word)
        self._busy = False

    def _over(self, reason: str) -> None:
        self._post(Crashed(reason))
        self._busy = False


# --- The control loop: one thread reads its slots, and sends the agent's heartbeat during an act --
# A motion is Lost if another loop process took over (the file was replaced) or the loop stands
# still. A hold after a fault is released when the agent asks for the posture; a person's stop is
# not. Where a look at a motion is due, it is asked for once, and everything else goes on until it
# is answered. A wait for the loop ends after a number of looks, not at a time: a machine that
# suspends this process loses no motion.

BEAT_S = 0.01  # the loop brings the arms to rest after 0.1 s without a beat
IDLE_S = 0.1
LOOK_S = 0.001
TAKEN_WITHIN_S = 2.0  # estimate: a loop takes a command within a cycle or a rest of 2 ms
SILENT_S = 2.0  # estimate: during a motion its state changes every 10 ms
# estimate: one read in thousands fails at full speed, two in a row are not seen
READ_WITHIN_S = 1.0
RELEASED_WITHIN_S = 5.0  # estimate: the dwell of a held robot is a fraction of a second


class Gone(Exception):
    """There is no loop, or not the one that got the motion, and `why`."""

    def __init__(self, why: Kind, text: str) -> None:
        self.why = (fact(why, "loop"),)
        super().__init__(text)


class LoopDevice:
    """Takes messages by `tell` and answers by `post`; a thread does the work."""

    busy = False

    def __init__(self, post: Post, path: Path) -> None:
        self._post, self._path = post, path
        self._words = OneReaderQueue[ToLoop | None]()
        self._link: AgentLink | None = None
        self._looking = False  # a look was asked for, and is not answered yet
        self._thread = threading.Thread(target=self._serve, name="loop link", daemon=True)
        self._thread.start()

    def tell(self, content: ToLoop) -> None:
        """Hand a message to the thread."""
        self._words.put(content)

    def close(self) -> None:
        """End the thread; a motion under way loses its heartbeat."""
        self._words.put(None)
        self._thread.join(timeout=1.0)

    # --- the thread -------------------------------------------------------------------------------

    def _serve(self) -> None:
        while (word := self._words.get()) is not None:
            if not self._do(word):
                return

    def _do(self, word: ToLoop) -> bool:
        """Carry out a message; return False if the thread has to end."""
        try:
            match word:
                case Where(number=number):
                    self._post(Stands(number, self._rest(self._reach())))
                case Halt(number=number):
                    return self._halt(number)
                case Do():
                    return self._carry_out(word)
                case GoOn() | Brake():
                    pass  # its motion has ended
        except Gone as gone:
            self._post(Lost(word.number, gone.why, str(gone)))
        return True

    def _reach(self) -> AgentLink:
        """Return the link to the running loop. Gone if there is none."""
        try:
            self._link = reopened(self._link, self._path)
        except SlotError as error:
            raise Gone(Kind.ENDED, f"the loop does not run: {error}") from None
        _state(self._link)
        return self._link

    def _halt(self, number: int) -> bool:
        while True:
            try:
                link = self._reach()
                # also in the place of a motion that the loop has not taken yet
                self._command(link, Cancel(None))
                self._until(link, lambda told: told.report.phase is not Phase.RUNNING)
                self._post(Stands(number, self._rest(link)))
                return True
            except Gone:
                if len(self._words):
                    return True  # a newer message, or the end
                time.sleep(IDLE_S)

    def _carry_out(self, word: Do) -> bool:
        link = self._reach()

        def moved(ended: Phase, why: Facts, text: str) -> bool:
            self._post(Moved(word.number, _felt(_state(link), link.told(), ended, why, text)))
            return True

        try:
            sent = self._command(link, word.motion)
        except SlotError as error:
            return moved(Phase.FAILED, (fact(Kind.MOTION_REFUSED, "knots"),), str(error))
        cycles, alike, self._looking = -1, 0, False
        while True:
            told, state = link.told(), _state(link)
            if told.refusal and told.taken == sent:
                return moved(Phase.FAILED, told.refusal.why, told.refusal.text)
            if told.taken >= sent and told.report.phase is not Phase.RUNNING:
                why = told.report.why
                return moved(told.report.phase, why, state.last_fault if why == FAULT else "")
            if told.look and not self._looking:
                self._looking = True
                self._post(Passing(word.number, _felt(_state(link), told, told.report.phase)))
            # Simulated time may stand still until the look is answered.
            alike = alike + 1 if state.cycles == cycles and not self._looking else 0
            cycles = state.cycles
            if link.file.replaced or alike * BEAT_S > SILENT_S:
                raise Gone(Kind.ENDED, "the loop ended in the middle of a motion")
            link.beat()
            if not self._meanwhile(link, word):
                return False

    def _meanwhile(self, link: AgentLink, word: Do) -> bool:
        """Take what is asked while a motion runs; return False if the thread has to end."""
        try:
            asked = self._words.get(BEAT_S)
        except Empty:
            return True
        if isinstance(asked, Brake):
            self._command(link, Cancel(asked.key))
        elif isinstance(asked, GoOn):
            self._command(link, LookAgain(asked.key, asked.look_in_s))
            self._looking = False
        elif isinstance(asked, Halt):
            self._command(link, Cancel(word.motion.key))
            self._words.put(asked)
        return asked is not None

    def _command(self, link: AgentLink, command: LoopCommand) -> int:
        """Send a command and wait until it is taken; return its number."""
        number = link.send(command)
        self._until(link, lambda told: told.taken >= number)
        return number

    def _until(self, link: AgentLink, reached: Callable[[LoopAnswer], bool]) -> None:
        for _ in _looks(TAKEN_WITHIN_S):
            if reached(link.told()):
                return
            if link.file.replaced:
                break
            link.beat()
        raise Gone(Kind.GAVE_NO_ANSWER, "the loop takes no commands")

    def _rest(self, link: AgentLink) -> Felt:
        """Return the posture; release the robot first if it is held after a fault."""
        for _ in _looks(RELEASED_WITHIN_S, IDLE_S):
            if _state(link).mode not in (Mode.DAMPING, Mode.HOLD):
                break
            self._command(link, Release())
        return _felt(_state(link), link.told(), Phase.IDLE)


def _state(link: AgentLink) -> LoopState:
    """Return the newest state. Try again if the reader met the writer, which waits for nobody. Gone
    after a second.
    """
    for _ in _looks(READ_WITHIN_S):
        if (state := link.state()) is not None:
            return state
    raise Gone(Kind.GAVE_NO_ANSWER, "the loop publishes no state")


def _looks(within_s: float, pause_s: float = LOOK_S) -> Iterator[None]:
    """Yield as many times as fit into `within_s` [s], with a pause after each."""
    for _ in range(round(within_s / pause_s)):
        yield
        time.sleep(pause_s)


def _felt(
    state: LoopState, told: LoopAnswer, ended: Phase, why: Facts = (), text: str = ""
) -> Felt:
    report = told.report
    return Felt(
        q=state.setpoint.tobytes(),
        measured=state.q.tobytes(),
        head=(float(state.head[0]), float(state.head[1])),
        time=state.time_s,
        world=state.world,
        epoch=state.epoch,
        ended=str(ended),
        why=why,
        text=text,
        touched={side: report.hand(side).touched for side in SIDES},
        grips={side: report.hand(side).grip for side in SIDES},
        fingers={side: float(np.mean(state.fingers(row)[0])) for row, side in enumerate(SIDES)},
    )


# --- Both ----------------------------------------------------------------------------------------


class RobotDevice:
    """A device made of two, and of telemetry where there is a loop to show."""

    def __init__(self, skills: Device, loop: Device, telemetry: Telemetry | None = None) -> None:
        self.skills, self.loop, self._telemetry = skills, loop, telemetry

    @property
    def busy(self) -> bool:
        """Whether one of them computes."""
        return self.skills.busy or self.loop.busy

    def tell(self, content: Any) -> None:
        """Hand a message to the loop or to the skills."""
        if self._telemetry is not None and isinstance(content, Perform):
            self._telemetry.skill = type(content.command).__name__
        (self.loop if isinstance(content, Where | Halt | Do | GoOn | Brake) else self.skills).tell(
            content
        )

    def close(self) -> None:
        """Close all of them."""
        if self._telemetry is not None:
            self._telemetry.close()
        self.skills.close()
        self.loop.close()
