"""The facts that methods of the domain need of a state at km: what is held, what stands where, what was seen."""

import numpy as np

from companion.languages import wm
from companion.languages.values import Side
from services.planner.search.asking import Asking
from velma import names

HOME_WITHIN = 0.1  # [rad] of each joint (estimate: more than the impedance control leaves)


class Facts:
    """Facts of a state; `state` is an id at km. Each method raises Unanswered if km does not know."""

    def __init__(self, ask: Asking) -> None:
        self._ask = ask

    def holder(self, state: str, name: str) -> Side | None:
        """Return the hand that holds the thing, None for none."""
        return self._ask(wm.CurrentGrasp(state=state, object=name), wm.GraspOf).side

    def in_hand(self, state: str, side: Side) -> str:
        """Return the thing in this hand, "" if empty."""
        return self._ask(wm.GraspAtSide(state=state, side=side), wm.GraspOf).object

    def at_home(self, state: str, side: Side) -> bool:
        """Whether the arm is in its start posture, wherever the torso is turned."""
        arm = self._ask(wm.ArmConfiguration(state=state, side=side), wm.Configuration).q
        return bool(np.abs(np.array(arm) - names.START[names.ARM[side]]).max() < HOME_WITHIN)

    def support(self, state: str, name: str) -> str:
        """Return the thing that this one stands on, "" if none is known."""
        return self._ask(wm.ObjectPose(state=state, object=name), wm.PoseOf).on

    def inside(self, state: str, name: str) -> bool:
        """Whether the thing stands inside another one, so that it must come out before anything is poured into it."""
        on = self.support(state, name)
        return bool(on) and self._true(state, wm.Relation.IS_IN, name, on)

    def exact(self, state: str, name: str) -> bool:
        """Whether the thing was seen where it stands, not only predicted to stand there."""
        return self._true(state, wm.Relation.HAS_EXACT_POSE, name)

    def _true(self, state: str, relation: str, subject: str, value: str = "") -> bool:
        query = wm.Holds(state=state, relation=relation, subject=subject, value=value)
        return self._ask(query, wm.Truth).value
