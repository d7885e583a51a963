"""The device of ex: skills, loop and telemetry behind one interface, which hands each message to the right one."""

from typing import Any

from agent_runtime.io.devices import Device
from services.executor.local import Brake, Do, GoOn, Halt, Perform, Where
from services.executor.telemetry import Telemetry


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
        (self.loop if isinstance(content, Where | Halt | Do | GoOn | Brake) else self.skills).tell(content)

    def close(self) -> None:
        """Close all of them."""
        if self._telemetry is not None:
            self._telemetry.close()
        self.skills.close()
        self.loop.close()
