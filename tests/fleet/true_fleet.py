"""Six agents in memory with the true search, the true skills, the true loop and simulated physics.

Loop and simulated Velma are beside ex's agent in one process: a motion is run in the call, to its
next look. Virtual time goes on by the simulated time it took; a Brake that answers no look
therefore always comes too late.
"""

from functools import partial

import numpy as np
from pretended_fleet import Fleet

from companion.eyes import Eyes
from companion.skills.loop_messages import Phase
from services.executor import device_messages
from services.executor.__main__ import RobotDevice
from services.executor.devices import SkillDevice
from services.executor.loop.core import LoopCore
from services.executor.renderer import Renderer
from services.planner.search import SearchDevice
from velma.model.scene import CANONICAL, load, vary
from velma.names import SIDES
from velma.sim.mujoco_backend import MujocoBackend
from velma.sim.truth import TruthReader


class TrueFleet(Fleet):
    """Six agents; search and skills are child processes, the loop is called."""

    def __init__(self, seed, eyes=Eyes.RAYS, scene=CANONICAL):
        backend = MujocoBackend(vary(load(scene), seed))
        self.truth = TruthReader(backend)
        self.core = LoopCore(backend)
        self.core.hold(0.4)
        setup = device_messages.Setup(str(scene), seed, eyes)

        def robot(post):
            skills = SkillDevice(post, setup, Renderer(partial(device_messages.scene_of, setup)))
            return RobotDevice(skills, CalledLoop(post, self.core))

        super().__init__(seed=seed, search=SearchDevice, robot=robot)


class CalledLoop:
    """A device over a core that outlives it."""

    busy = False

    def __init__(self, post, core):
        self._post, self._core = post, core

    def tell(self, content):
        """Do it now."""
        match content:
            case device_messages.Where(number=number) | device_messages.Halt(number=number):
                self._post(device_messages.Stands(number, self._felt("idle", ())))
            case device_messages.Do(number=number, motion=motion):
                self._core.begin(motion)
                self._go_on(number)
            case device_messages.GoOn(number=number) if self._core.look_due:
                self._core.look_again(content.key, content.look_in_s)
                self._go_on(number)
            case device_messages.Brake(number=number) if self._core.look_due:
                self._core.cancel(content.key)
                self._go_on(number)

    def _go_on(self, number):
        began = self._core.state.time
        while self._core.report.phase is Phase.RUNNING and not self._core.look_due:
            self._core.cycle()
        report = self._core.report
        felt = self._felt(str(report.phase), report.why)
        word = device_messages.Passing if report.phase is Phase.RUNNING else device_messages.Moved
        self._post(word(number, felt), felt.time - began)

    def close(self):
        """The loop goes on without its agent."""

    def _felt(self, ended, why):
        core = self._core
        state, report = core.state, core.report
        return device_messages.Felt(
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
