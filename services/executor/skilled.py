"""The worker of ex as a device: one child process, killed by Drop, started anew at once so that it is warm again."""

from agent_runtime.io.devices import Post
from agent_runtime.io.worker import Worker
from services.executor.words import Crashed, Drop, Feel, FromWorker, Perform, Setup

ENTRY = "services.executor.worker:serve"


class Skilled:
    """busy: from a word to the child until it says something."""

    def __init__(self, post: Post, setup: Setup) -> None:
        self._post, self._setup = post, setup
        self._busy = self._acting = False
        self._child = self._new()

    @property
    def busy(self) -> bool:
        """The child computes."""
        return self._busy

    def tell(self, content: Perform | Feel | Drop) -> None:
        """Hand a word to the child; Drop kills one that is in the middle of an act."""
        if not self._child.alive or (self._acting and not isinstance(content, Feel)):
            self._child.kill()
            self._child, self._acting, self._busy = self._new(), False, False
        if not isinstance(content, Drop):
            self._acting = self._busy = True
            self._child.tell(content)

    def close(self) -> None:
        """Kill the child."""
        self._child.kill()

    def _new(self) -> Worker:
        child = Worker(ENTRY, answers=FromWorker, on_message=self._heard, on_end=self._over)
        child.tell(self._setup)
        return child

    def _heard(self, word: FromWorker) -> None:
        self._acting = not hasattr(word, "outcome")
        self._post(word)
        self._busy = False

    def _over(self, code: int) -> None:
        self._post(Crashed(code))
        self._busy = False
