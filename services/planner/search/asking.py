"""Queries to km: one function from query to answer, with types, a cache and a count."""

from collections.abc import Callable
from typing import TypeVar

from companion.languages import wm

A = TypeVar("A", bound=wm.Answer)


class Unanswered(Exception):
    """km cannot answer, so this branch of the search ends."""

    def __init__(self, query: wm.AnyQuery, reason: str) -> None:
        self.query, self.reason = query, reason
        super().__init__(f"{type(query).__name__}: {reason}")


class Asking:
    """Asks each query once (an answer is a pure function of query and state) and counts the queries."""

    def __init__(self, ask: Callable[[wm.AnyQuery], wm.AnyAnswer], request: str) -> None:
        self._ask, self.request = ask, request
        self._known: dict[wm.AnyQuery, wm.AnyAnswer] = {}
        self._states: dict[tuple[str, tuple[wm.AnyChange, ...]], str] = {}
        self.queries = 0

    def __call__(self, query: wm.AnyQuery, kind: type[A]) -> A:
        """Return the answer of class `kind`. Raises Unanswered for Unknown or any other class."""
        if query not in self._known:
            self.queries += 1
            self._known[query] = self._ask(query)
        answer = self._known[query]
        if isinstance(answer, kind):
            return answer
        reason = answer.reason if isinstance(answer, wm.Unknown) else f"answered with a {type(answer).__name__}"
        raise Unanswered(query, reason)

    def suppose(self, state: str, changes: tuple[wm.AnyChange, ...]) -> str:
        """Have km make a hypothetical state, `state` with these changes, once; return its id. Raise Unanswered."""
        if (state, changes) not in self._states:
            name = f"{self.request}/{len(self._states) + 1}"
            self._states[state, changes] = self(wm.HypotheticalState(state=state, id=name, changes=changes), wm.Made).id
        return self._states[state, changes]
