"""The skill process as a device of ex: started for an act, ended a minute after the last one. Drop
kills it.
"""

import threading

from msgspec.structs import replace

from agent_runtime.io.devices import Post
from agent_runtime.io.worker import Worker
from companion.eyes import Eyes
from services.executor.device_messages import (
    ByRays,
    Crashed,
    Drop,
    Feel,
    FromSkill,
    Glance,
    Perform,
    Setup,
)
from services.executor.eye_messages import See
from services.executor.renderer import Renderer

ENTRY = "services.executor.skill_process:serve"
REST_S = 60.0
"""Without an act, until the process is ended; estimate: a plan has its acts one after the other."""


class SkillDevice:
    """Busy from a message to the child until its answer. `renderer`: looks for eyes by pixels."""

    def __init__(self, post: Post, setup: Setup, renderer: Renderer) -> None:
        self._post, self._setup, self._renderer = post, setup, renderer
        self._busy = self._acting = False
        self._child: Worker | None = None
        self._lock, self._rest = threading.Lock(), threading.Timer(0.0, lambda: None)

    @property
    def busy(self) -> bool:
        """Whether the child computes."""
        return self._busy

    @property
    def pid(self) -> int:
        """The child's process; 0: none runs."""
        child = self._child
        return child.pid if child is not None and child.alive else 0

    def tell(self, content: Perform | Feel | Glance | Drop) -> None:
        """Hand a message to the child; Drop kills a child in the middle of an act."""
        with self._lock:
            self._rest.cancel()
            if self._child is not None and (
                not self._child.alive or (self._acting and not isinstance(content, Feel | Glance))
            ):
                self._end()
            if not isinstance(content, Drop):
                if self._child is None:
                    self._child = self._new()
                if self._setup.eyes is Eyes.PIXELS and isinstance(content, Perform):
                    self._renderer.start()
                self._acting = self._busy = True
                self._child.tell(content)
            else:
                self._rest_later()

    def close(self) -> None:
        """Kill both processes."""
        with self._lock:
            self._rest.cancel()
            self._end()
        self._renderer.close()

    def _new(self) -> Worker:
        child = Worker(
            ENTRY,
            answers=FromSkill,
            on_message=lambda word: self._heard(child, word),
            on_end=self._over,
        )
        child.tell(self._setup)
        return child

    def _end(self) -> None:
        if self._child is not None:
            self._child.kill()
        self._child, self._acting, self._busy = None, False, False

    def _rest_later(self) -> None:
        self._rest = threading.Timer(REST_S, self._rested)
        self._rest.daemon = True
        self._rest.start()

    def _rested(self) -> None:
        with self._lock:
            if not self._acting and threading.current_thread() is self._rest:
                self._end()

    def _heard(self, child: Worker, word: FromSkill) -> None:
        if isinstance(word, See):
            self._renderer.look(word, child.tell)
            return
        if isinstance(word, ByRays):  # the act goes on; a child that follows does not try again
            self._setup = replace(self._setup, eyes=Eyes.RAYS)
            self._post(word)
            return
        self._acting = not hasattr(word, "outcome")
        if not self._acting:
            self._rest_later()
        self._post(word)
        self._busy = False

    def _over(self, reason: str) -> None:
        self._post(Crashed(reason))
        self._busy = False
