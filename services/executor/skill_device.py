"""The skill process as a device of ex. Drop kills it; a new one is started at once, to be loaded when needed."""

from msgspec.structs import replace

from agent_runtime.io.devices import Post
from agent_runtime.io.worker import Worker
from companion.eyes import Eyes
from services.executor.local import ByRays, Crashed, Drop, Feel, FromSkill, Glance, Perform, Setup

ENTRY = "services.executor.skill_process:serve"


class SkillDevice:
    """Busy from a message to the child until its answer."""

    def __init__(self, post: Post, setup: Setup) -> None:
        self._post, self._setup = post, setup
        self._busy = self._acting = False
        self._child = self._new()

    @property
    def busy(self) -> bool:
        """Whether the child computes."""
        return self._busy

    def tell(self, content: Perform | Feel | Glance | Drop) -> None:
        """Hand a message to the child; Drop kills a child in the middle of an act."""
        if not self._child.alive or (self._acting and not isinstance(content, Feel | Glance)):
            self._child.kill()
            self._child, self._acting, self._busy = self._new(), False, False
        if not isinstance(content, Drop):
            self._acting = self._busy = True
            self._child.tell(content)

    def close(self) -> None:
        """Kill the child."""
        self._child.kill()

    def _new(self) -> Worker:
        child = Worker(ENTRY, answers=FromSkill, on_message=self._heard, on_end=self._over)
        child.tell(self._setup)
        return child

    def _heard(self, word: FromSkill) -> None:
        if isinstance(word, ByRays):  # the act goes on; a child that follows does not try again
            self._setup = replace(self._setup, eyes=Eyes.RAYS)
            self._post(word)
            return
        self._acting = not hasattr(word, "outcome")
        self._post(word)
        self._busy = False

    def _over(self, reason: str) -> None:
        self._post(Crashed(reason))
        self._busy = False
