"""The search as a child process of pl, which can be killed: it sends Ask, which is answered by
Answer, or Found.

The search with its geometry is loaded in the child only.
"""

from agent_runtime.io.worker import Link
from companion.languages import wm
from services.planner.device_messages import Answer, Ask, Begin, Found, ToSearch


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
