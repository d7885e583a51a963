"""The search as a child process of pl, which can be killed: it sends Ask, Found or NotFound and is answered by Answer.

The search with its geometry is loaded in the child only.
"""

from agent_runtime.io.worker import Link
from companion.languages import hfsm, wm
from services.planner.local import Answer, Ask, Begin, Found, NotFound, ToSearch


def serve(link: Link) -> None:
    """Run one search after the other, until the agent is gone."""
    from services.planner.search.search import search

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
    if isinstance(found, hfsm.HierarchicalPlan):
        return Found(attempt, found)
    return NotFound(attempt, found.why, found.rejected)
