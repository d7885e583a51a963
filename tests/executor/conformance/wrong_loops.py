"""Loops that are wrong on purpose: the kit looks at the loop around a back-end, too."""

import numpy as np

from companion.skills.loop_messages import Mode
from services.executor.loop.core import LoopCore
from services.executor.loop.link import _HEAD, Slot
from services.executor.loop.process import LoopProcess, Pacer


class BlindPacer(Pacer):
    """Late cycles are not counted."""

    def done(self):
        self._cycles += 1


class TornSlot(Slot):
    """Writes without saying so."""

    def write(self, record):
        number = self.number
        self._view[_HEAD.size : _HEAD.size + len(record)] = record
        _HEAD.pack_into(self._view, 0, number + 2, len(record))
        return number + 2


class Unlimited(LoopCore):
    """Torques as the law has them."""

    def _send(self, tau):
        self.command.tau[:] = tau
        self.backend.step(self.command)


class Deaf(LoopCore):
    """Holds on a stop for a while, then goes on."""

    def stop(self):
        super().stop()
        self.release()


class Hasty(LoopCore):
    """A stop that is over as soon as it is released."""

    def release(self):
        self.mode = Mode.MOTION


class Pushing(LoopCore):
    """After a fault the last torque goes on."""

    def _send(self, tau):
        super()._send(np.where(self.mode is Mode.DAMPING, self.command.tau, tau))


class Fragile(LoopCore):
    """A fault leaves the cycle without a command."""

    def cycle(self):
        self.state = self.backend.observe()
        self._check(self.state)
        self._send(self._control(self.state))
        self.cycles += 1


class Orphan(LoopProcess):
    """Goes on without an agent."""

    def _listen(self):
        pass


class StopLess(LoopProcess):
    """Does not look at the stop file."""

    def _people(self):
        pass


class Abrupt(LoopProcess):
    """Ends in the middle of it."""

    def end(self, cycles=50):
        for _ in range(cycles):
            self.core.cycle()


class Behind(LoopProcess):
    """Shows the state before the last."""

    def _publish(self):
        if self.core.cycles < 300:
            super()._publish()

    def _show(self):
        pass
