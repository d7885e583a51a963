"""Queries to km: one function from query to answer, with types, a cache and a count."""

from collections.abc import Callable
from typing import TypeVar

from companion.languages import wm
from companion.languages.facts import Facts, Kind, fact

A = TypeVar("A", bound=wm.Answer)


class Unanswered(Exception):
    """km cannot answer, so this branch of the search ends."""

    def __init__(self, query: wm.AnyQuery, why: Facts) -> None:
        self.query, self.why = query, why
        super().__init__(f"{type(query).__name__}: {', '.join(one.kind for one in why)}")


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
        unknown = (fact(Kind.UNKNOWN_TO_KM, type(query).__name__),)
        raise Unanswered(query, answer.why if isinstance(answer, wm.Unknown) else unknown)

    def suppose(self, state: str, changes: tuple[wm.AnyChange, ...]) -> str:
        """Have km make a hypothetical state, `state` with these changes, once; return its id. Raise Unanswered."""
        if (state, changes) not in self._states:
            name = f"{self.request}/{len(self._states) + 1}"
            self._states[state, changes] = self(wm.HypotheticalState(state=state, id=name, changes=changes), wm.Made).id
        return self._states[state, changes]
