"""Step logs of agents that do not run: of a recording that is said again, and of tests."""

from contextlib import suppress
from pathlib import Path

import msgspec

from agent_runtime.core.events import Arrived, Garbled, Next
from agent_runtime.io.steplog import BOOT, NOTHING, Said, Step, StepLog, checked
from fipa_codec.communicate import Communicate, encode
from fipa_codec.errors import FipaError

LIFE = 1


class StepLogs:
    """The logs of a run folder, AGENT.steps in its folder steps; each line is in its file at once."""

    def __init__(self, run: Path) -> None:
        self._folder = run / "steps"

    def passed(self, one: Communicate, at: float) -> None:
        """Its sender said it at `sent`, and its receiver took it at `at` [unix s]."""
        self.said(one, one.sent or at)
        self.took(one, at)

    def said(self, one: Communicate, at: float) -> None:
        """Its sender said it."""
        bare, check = checked(one)
        with suppress(FipaError):
            self._note(one.sender, at, Next(), (Said(bare, len(encode(one)), check),))

    def took(self, one: Communicate, at: float) -> None:
        """Its receiver took it."""
        self._note(one.receiver, at, Arrived(one))

    def garbled(self, key: str, why: str, at: float) -> None:
        """Bytes came on a key that were no communicate."""
        self._note(key.split("/")[4], at, Garbled(key, why))

    def boots(self, agent: str, incarnation: int, at: float) -> None:
        """A life of an agent begins."""
        self._write(agent, Step(incarnation, 0, at, BOOT, b""))

    def _note(self, agent: str, at: float, event: Arrived | Garbled | Next, said: tuple[Said, ...] = ()) -> None:
        self._write(agent, Step(LIFE, 0, at, type(event).__name__, msgspec.msgpack.encode(event), said=said))

    def _write(self, agent: str, step: Step) -> None:
        log = StepLog(self._folder / f"{agent}.steps")
        log.write([(step, NOTHING)])
        log.close()
