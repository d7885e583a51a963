"""What the methods of the domain want to know of a state of km: who holds what, what stands where, what was seen."""

from companion.languages import wm
from companion.languages.values import Side
from services.planner.search.asking import Asking


class Facts:
    """Yes, no or which hand; each raises Unanswered where km does not know. `state` is an id of km."""

    def __init__(self, ask: Asking) -> None:
        self._ask = ask

    def holder(self, state: str, name: str) -> Side | None:
        """The hand that holds the thing."""
        return self._ask(wm.CurrentGrasp(state=state, object=name), wm.GraspOf).side

    def in_hand(self, state: str, side: Side) -> str:
        """The thing in this hand, "" where it is empty."""
        return self._ask(wm.GraspAtSide(state=state, side=side), wm.GraspOf).object

    def support(self, state: str, name: str) -> str:
        """The thing that this one stands on, "" where none is known."""
        return self._ask(wm.ObjectPose(state=state, object=name), wm.PoseOf).on

    def inside(self, state: str, name: str) -> bool:
        """Whether the thing stands inside another one, so that it has to come out before anything is poured into it."""
        on = self.support(state, name)
        return bool(on) and self._true(state, "isIn", name, on)

    def exact(self, state: str, name: str) -> bool:
        """Whether the thing was seen where it stands, not only predicted to stand there."""
        return self._true(state, "hasExactPose", name)

    def _true(self, state: str, relation: str, subject: str, value: str = "") -> bool:
        query = wm.Holds(state=state, relation=relation, subject=subject, value=value)
        return self._ask(query, wm.Truth).value
