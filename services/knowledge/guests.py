"""The door of km: guests of the design ask what was observed, and are answered without the agent.

An answer is a pure function of the scene, which the agent tells its device at each change, and of
the hypothetical states that the same guest made. Must not know: those of the agent.
"""

import threading
from typing import Any

from agent_runtime.io.devices import Device, DeviceMaker, Post
from agent_runtime.io.guests import Asked, Door
from companion.design import DESIGN, LANGUAGES, AgentName
from companion.languages import wm
from companion.world.scene import Scene
from fipa_codec.performatives import Performative as P
from services.knowledge.answers import ask
from services.knowledge.memory import Mirror, Overlays
from services.knowledge.outgoing_messages import NOT_YET


class KmDevice:
    """The device of km: its store, and guests."""

    def __init__(self, post: Post, store: Device) -> None:
        self._store = store
        self._lock = threading.Lock()
        self._scene: Scene | None = None
        self._overlays: dict[str, Overlays] = {}
        self._door = Door(DESIGN, LANGUAGES, AgentName.KM, post, self._asked)

    @property
    def busy(self) -> bool:
        return self._store.busy

    def tell(self, content: Any) -> None:
        """Take a scene of the agent."""
        if isinstance(content, Mirror):
            with self._lock:
                self._scene = content.scene
        self._store.tell(content)

    def close(self) -> None:
        """Close the store."""
        self._store.close()

    def _asked(self, asked: Asked) -> None:
        said: wm.AnyAnswer = NOT_YET
        with self._lock:
            if self._scene is not None and self._scene.things:
                mine = self._overlays.get(asked.guest, Overlays())
                self._overlays[asked.guest], said = ask(self._scene, mine, asked.content)
        unknown = isinstance(said, wm.Unknown | wm.UnknownState)
        self._door.say(asked.conversation, P.FAILURE if unknown else P.INFORM_REF, said)


def with_guests(store: DeviceMaker) -> DeviceMaker:
    """The device of km, whose store is made so."""
    return lambda post: KmDevice(post, store(post))
