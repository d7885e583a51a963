"""Words between an agent that is a guest of an included system (topdown.model.elements.Include) and
the device that carries them (agent_runtime.io.visiting).

They are no communicates of this system. A step that has one is judged by the agent's rows as if
they were: what is told is said in the use, what is heard is taken in it, and a conversation that is
given up is `late USE`.
"""

from typing import Any

import msgspec

from fipa_codec.languages import Kind
from fipa_codec.performatives import Performative


class GuestSays(msgspec.Struct, frozen=True, tag=True):
    """To the device: say this. `use`: as the design has it, `NAME.USE`; `conversation`: chosen by
    the agent, of which one at a time is open in a use.
    """

    use: str
    conversation: str
    act: Performative
    content: Any = None


class GuestLeaves(msgspec.Struct, frozen=True, tag=True):
    """To the device: call off a conversation that an earlier life of the agent opened; nothing of
    it is heard.
    """

    use: str
    conversation: str


class GuestHears(msgspec.Struct, frozen=True, tag=True):
    """From the device: the included system said this. `content`: in plain values."""

    use: str
    conversation: str
    act: Performative
    kind: Kind = Kind.PLAIN
    content: Any = None


class GuestLost(msgspec.Struct, frozen=True, tag=True):
    """From the device: nothing more comes in this conversation, and why."""

    use: str
    conversation: str
    why: str
