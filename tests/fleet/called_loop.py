"""The true loop and simulated Velma beside ex's agent in one process: a motion is run in the call, to its next look.

Virtual time goes on by the simulated time it took; a Brake that answers no look therefore always comes too late.
"""

import numpy as np

from agent_runtime.io.devices import Post
from companion.languages.facts import Facts
from companion.skills.loop_messages import Phase
from services.executor.local import Brake, Do, Felt, GoOn, Halt, Moved, Passing, Stands, Where
from services.executor.loop.core import LoopCore
from velma.names import SIDES


class CalledLoop:
    """A device over a core that outlives it."""

    busy = False

    def __init__(self, post: Post, core: LoopCore) -> None:
        self._post, self._core = post, core

    def tell(self, content: Where | Halt | Do | GoOn | Brake) -> None:
        """Do it now."""
        match content:
            case Where(number=number) | Halt(number=number):
                self._post(Stands(number, self._felt("idle", ())))
            case Do(number=number, motion=motion):
                self._core.begin(motion)
                self._go_on(number)
            case GoOn(number=number) if self._core.look_due:
                self._core.look_again(content.key, content.look_in_s)
                self._go_on(number)
            case Brake(number=number) if self._core.look_due:
                self._core.cancel(content.key)
                self._go_on(number)

    def _go_on(self, number: int) -> None:
        began = self._core.state.time
        while self._core.report.phase is Phase.RUNNING and not self._core.look_due:
            self._core.cycle()
        report = self._core.report
        felt = self._felt(str(report.phase), report.why)
        word = Passing if report.phase is Phase.RUNNING else Moved
        self._post(word(number, felt), felt.time - began)

    def close(self) -> None:
        """The loop goes on without its agent."""

    def _felt(self, ended: str, why: Facts) -> Felt:
        core = self._core
        state, report = core.state, core.report
        return Felt(
            q=core.setpoint.tobytes(),
            measured=state.q.tobytes(),
            head=(float(state.head[0]), float(state.head[1])),
            time=float(state.time),
            world=np.asarray(core.backend.configuration()).tobytes(),
            ended=ended,
            why=why,
            touched={side: report.hand(side).touched for side in SIDES},
            grips={side: report.hand(side).grip for side in SIDES},
            fingers={side: float(np.mean(state.proximal[row])) for row, side in enumerate(SIDES)},
        )
