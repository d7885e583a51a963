"""What stands beside ex's agent: its worker, its loop and what it shows people, one device that hands each word on."""

from typing import Any

from agent_runtime.io.devices import Device
from services.executor.telling import Telling
from services.executor.words import Brake, Do, Halt, Perform, Where


class Body:
    """A device made of two, and of telemetry where there is a loop to tell of."""

    def __init__(self, skills: Device, loop: Device, telling: Telling | None = None) -> None:
        self.skills, self.loop, self._telling = skills, loop, telling

    @property
    def busy(self) -> bool:
        """One of them computes."""
        return self.skills.busy or self.loop.busy

    def tell(self, content: Any) -> None:
        """To the loop what is for the loop."""
        if self._telling is not None and isinstance(content, Perform):
            self._telling.skill = type(content.command).__name__
        (self.loop if isinstance(content, Where | Halt | Do | Brake) else self.skills).tell(content)

    def close(self) -> None:
        """Close them all."""
        if self._telling is not None:
            self._telling.close()
        self.skills.close()
        self.loop.close()
