"""The device of pl: a child process that searches, or waits for the next request with everything
loaded.

Loading the geometry takes some seconds, so the child does it before it is needed. Stop kills the
searching child at once; the next child is started in its place.
"""

from agent_runtime.io.devices import Post
from agent_runtime.io.worker import Worker
from services.planner.device_messages import Answer, Begin, Died, Found, FromSearch, Stop

ENTRY = "services.planner.search_process:serve"


class SearchDevice:
    """Busy from a message to the child until its answer."""

    def __init__(self, post: Post) -> None:
        self._post = post
        self._busy = self._searching = False
        self._child = self._new()

    @property
    def busy(self) -> bool:
        return self._busy

    def tell(self, content: Begin | Answer | Stop) -> None:
        """Hand a message to the child, or kill it."""
        if (self._searching and isinstance(content, Stop | Begin)) or not self._child.alive:
            self._child.kill()
            self._child, self._searching, self._busy = self._new(), False, False
        if isinstance(content, Begin | Answer):
            self._searching = self._busy = True
            self._child.tell(content)

    def close(self) -> None:
        """Kill the child."""
        self._child.kill()

    def _new(self) -> Worker:
        return Worker(ENTRY, answers=FromSearch, on_message=self._on_message, on_end=self._on_end)

    def _on_message(self, message: FromSearch) -> None:
        self._searching = self._searching and not isinstance(message, Found)
        self._post(message)
        self._busy = False

    def _on_end(self, reason: str) -> None:
        self._post(Died(reason))
        self._busy = False
