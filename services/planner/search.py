"""The search of pl: a child process that can be killed, the device that keeps one, their messages.

The child sends Ask, which is answered by Answer, or Found. The search with its geometry is loaded
in the child only. None of the messages is a communicate, none leaves the computer. A message names
the attempt that it belongs to, so that messages of a killed process are not taken for the next
one's.
"""

import msgspec

from agent_runtime.io.devices import Post
from agent_runtime.io.worker import Link, Worker
from companion.languages import hfsm, wm


class Message(msgspec.Struct, frozen=True, tag=True):
    """A message between agent and search; `attempt` counts searches over all lives of the agent."""

    attempt: int


class Begin(Message, frozen=True):
    """Search for a plan of this network; `seed` of the random numbers."""

    network: hfsm.GroundTaskNetwork
    seed: int


class Stop(Message, frozen=True):
    """The plan is not wanted any more."""


class Answer(Message, frozen=True):
    """The answer of km."""

    answer: wm.AnyAnswer


class Ask(Message, frozen=True):
    """A query for km that the search needs answered."""

    query: wm.AnyQuery


class Found(Message, frozen=True):
    """The end of a search, as co is told it: a plan, or why there is none."""

    plan: hfsm.HierarchicalPlan | hfsm.NoPlan


class Died(msgspec.Struct, frozen=True, tag=True):
    """The child process ended by itself, and why."""

    reason: str


ToSearch = Begin | Answer
FromSearch = Ask | Found
Local = Ask | Found | Died


# --- The device: a child that searches, or waits with everything loaded ---------------------------
# Loading the geometry takes some seconds, so the child does it before it is needed. Stop kills the
# searching child at once; the next child is started in its place.

ENTRY = "services.planner.search:serve"


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


# --- The child ------------------------------------------------------------------------------------


def serve(link: Link) -> None:
    """Run one search after the other, until the agent is gone."""
    from companion.planning.search import search

    while True:
        message = link.recv(ToSearch)
        if not isinstance(message, Begin):
            continue
        attempt = message.attempt

        def ask(query: wm.AnyQuery, attempt: int = attempt) -> wm.AnyAnswer:
            link.send(Ask(attempt, query))
            while True:
                reply = link.recv(ToSearch)
                if isinstance(reply, Answer) and reply.attempt == attempt:
                    return reply.answer

        link.send(Found(attempt, search(message.network, ask, message.seed)))
