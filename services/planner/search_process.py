"""The search as a killable child process of a_pl: it yields Ask, Found or NotFound and is answered by Answer.

Here also are the words between agent and child. The agent imports this module without the search: geometry and its
libraries are loaded in the child only. A word names the attempt it belongs to, so that what a killed child had
said before is not taken for the words of the next one.
"""

import msgspec

from agent_runtime.io.worker import Link
from companion.languages import hfsm, wm


class Word(msgspec.Struct, frozen=True, tag=True):
    """A word between agent and search; `attempt` counts searches over all lives of the agent."""

    attempt: int


class Begin(Word, frozen=True):
    """Search a plan for this network; `seed` of all chance in it."""

    network: hfsm.GroundTaskNetwork
    seed: int


class Stop(Word, frozen=True):
    """Nobody wants the plan any more."""


class Answer(Word, frozen=True):
    """What km answered."""

    answer: wm.AnyAnswer


class Ask(Word, frozen=True):
    """The search cannot go on without this fact."""

    query: wm.AnyQuery


class Found(Word, frozen=True):
    """There is a plan."""

    plan: hfsm.HierarchicalPlan


class NotFound(Word, frozen=True):
    """There is none, and why."""

    reason: str


class Died(msgspec.Struct, frozen=True, tag=True):
    """The child ended by itself with this exit status."""

    code: int


ToSearch = Begin | Answer
FromSearch = Ask | Found | NotFound
Local = Ask | Found | NotFound | Died


def serve(link: Link) -> None:
    """The child: one search after another."""
    from services.planner.search.search import search
    from velma.kinematics import timing

    timing.loaded()
    while True:
        word = link.recv(ToSearch)
        if not isinstance(word, Begin):
            continue
        attempt = word.attempt

        def ask(query: wm.AnyQuery, attempt: int = attempt) -> wm.AnyAnswer:
            link.send(Ask(attempt, query))
            while True:
                reply = link.recv(ToSearch)
                if isinstance(reply, Answer) and reply.attempt == attempt:
                    return reply.answer

        link.send(_result(attempt, search(word.network, ask, word.seed)))


def _result(attempt: int, found: hfsm.HierarchicalPlan | hfsm.NoPlan) -> Found | NotFound:
    return Found(attempt, found) if isinstance(found, hfsm.HierarchicalPlan) else NotFound(attempt, found.reason)
