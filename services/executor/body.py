"""What stands beside ex's agent: its worker and its loop, one device that hands each word to the one it is for."""

from typing import Any

from agent_runtime.devices import Device
from services.executor.words import Brake, Do, Halt, Where


class Body:
    """A device made of two."""

    def __init__(self, skills: Device, loop: Device) -> None:
        self.skills, self.loop = skills, loop

    @property
    def busy(self) -> bool:
        """One of them computes."""
        return self.skills.busy or self.loop.busy

    def tell(self, content: Any) -> None:
        """To the loop what is for the loop."""
        (self.loop if isinstance(content, Where | Halt | Do | Brake) else self.skills).tell(content)

    def close(self) -> None:
        """Close both."""
        self.skills.close()
        self.loop.close()
