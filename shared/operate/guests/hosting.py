"""What a system adds to what its guests are offered: things to read, and words to begin with
(operate.system.Additions.guests).

Must not know: by which protocol programs come in.
"""

from collections.abc import Awaitable, Callable
from typing import Any, NamedTuple

from agent_runtime.io.guests import Visit
from operate.guests.errands import Errand, Errands
from operate.guests.offers import Offer
from operate.system import System

UNTRUSTED = "untrusted"
"""The name under which programs get what comes of the world: it is data, whoever wrote it."""
STOP = "stop"
"""What stops the robot, for every guest: nobody is asked, and no right is needed."""


class Resource(NamedTuple):
    """Something that can be read. `read` gives text, bytes, or None where there is nothing yet."""

    name: str
    text: str
    mime: str
    read: Callable[[], Awaitable[str | bytes | None]]


class Prompt(NamedTuple):
    """Words for a person to begin with. `arguments`: name -> what it is, a blank of `says` each."""

    name: str
    text: str
    arguments: dict[str, str]
    says: str


class Host(NamedTuple):
    """What the additions of a system are made of. `name`: of the system, in its keys; `changed`:
    to be called where a resource of this name changed, on any thread.
    """

    system: System
    name: str
    visit: Visit
    errands: Errands
    offers: dict[str, Offer]
    changed: Callable[[str], None]

    async def ask(self, offer: str, **arguments: Any) -> Errand:
        """What a question is answered. Raise NoAnswerError."""
        one = self.offers[offer]
        return await self.errands.do(one, one.read(arguments))


class Extra(NamedTuple):
    """The additions of a system. `after`: names of the resources that may have changed when a task
    ended.
    """

    resources: tuple[Resource, ...] = ()
    prompts: tuple[Prompt, ...] = ()
    after: tuple[str, ...] = ()


class Served(NamedTuple):
    """What a server has for its guest. `name`: of the system; `version`: of the installation;
    `stop` stops the robot and says what came of it.
    """

    name: str
    version: str
    guest: str
    offers: tuple[Offer, ...]
    resources: tuple[Resource, ...]
    prompts: tuple[Prompt, ...]
    stop: Callable[[], str]
