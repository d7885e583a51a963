"""What methods of tasks decide by: facts of a state at km, and the notes why something is not done.

A method gets Known, the id of the state at km, and the arguments of its task. It returns subtasks,
or None if it does not apply; it raises Unanswered if km does not know a fact. Must not know:
geometry.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, TypeVar

import numpy as np
import pinocchio as pin

from companion.languages import wm
from companion.languages.cmd import BACK
from companion.languages.facts import Fact, Facts, Kind, fact
from companion.languages.values import Side
from companion.models import looked_into
from velma import names
from velma.kinematics.frames import lies, transform, upside_down

A = TypeVar("A", bound=wm.Answer)


class Unanswered(Exception):
    """km cannot answer, so this branch of the search ends."""

    def __init__(self, query: wm.AnyQuery, why: Facts) -> None:
        self.query, self.why = query, why
        super().__init__(f"{type(query).__name__}: {', '.join(one.kind for one in why)}")


class Asking:
    """Asks each query once (an answer is a pure function of query and state) and counts the
    queries.
    """

    def __init__(self, ask: Callable[[wm.AnyQuery], wm.AnyAnswer], request: str) -> None:
        self._ask, self.request = ask, request
        self._known: dict[wm.AnyQuery, wm.AnyAnswer] = {}
        self._states: dict[tuple[str, tuple[wm.AnyChange, ...]], str] = {}
        self.queries = 0

    def __call__(self, query: wm.AnyQuery, kind: type[A]) -> A:
        """The answer of class `kind`. Raises Unanswered for Unknown or any other class."""
        if query not in self._known:
            self.queries += 1
            self._known[query] = self._ask(query)
        answer = self._known[query]
        if isinstance(answer, kind):
            return answer
        unknown = (fact(Kind.UNKNOWN_TO_KM, type(query).__name__),)
        raise Unanswered(query, answer.why if isinstance(answer, wm.Unknown) else unknown)

    def suppose(self, state: str, changes: tuple[wm.AnyChange, ...]) -> str:
        """Have km make a hypothetical state, `state` with these changes, once; return its id. Raise
        Unanswered.
        """
        if (state, changes) not in self._states:
            name = f"{self.request}/{len(self._states) + 1}"
            self._states[state, changes] = self(
                wm.HypotheticalState(state=state, id=name, changes=changes), wm.Made
            ).id
        return self._states[state, changes]


# --- What methods of tasks decide by: facts of a state at km, and the notes why something is not
# done


# --- The facts that methods of the domain need of a state at km: what is held, what stands where,
# what was seen


SAME_PLACE_M = 0.05  # nearer to where it stood before, a thing is there again (estimate)
# nearer than this a thing may be in a hand's way to another one; in height (estimates)
BESIDE_M, LEVEL_M = 0.4, 0.3
HOME_WITHIN = 0.1  # [rad] of each joint (estimate: more than the impedance control leaves)


class StateFacts:
    """Facts of a state; `state` is an id at km. Each method raises Unanswered if km does not
    know.
    """

    def __init__(self, ask: Asking) -> None:
        self._ask = ask

    def holder(self, state: str, name: str) -> Side | None:
        """The hand that holds the thing, None for none."""
        return self._ask(wm.CurrentGrasp(state=state, object=name), wm.GraspOf).side

    def in_hand(self, state: str, side: Side) -> str:
        """The thing in this hand, "" if empty."""
        return self._ask(wm.GraspAtSide(state=state, side=side), wm.GraspOf).object

    def at_home(self, state: str, side: Side) -> bool:
        """Whether the arm is in its start posture, wherever the torso is turned."""
        arm = self._ask(wm.ArmConfiguration(state=state, side=side), wm.Configuration).q
        return bool(np.abs(np.array(arm) - names.START[names.ARM[side]]).max() < HOME_WITHIN)

    def support(self, state: str, name: str) -> str:
        """The thing that this one stands on, "" if none is known."""
        return self._ask(wm.ObjectPose(state=state, object=name), wm.PoseOf).on

    def places(self, state: str, word: str) -> tuple[str, ...]:
        """The furniture of this id or class: "table" is any table."""
        found = self._ask(wm.StaticObjects(state=state), wm.Objects).objects
        kind = word.capitalize()
        return tuple(
            one.id
            for one in found
            if word == one.id or self._true(state, wm.Relation.IS_INSTANCE_OF, one.id, kind)
        )

    def moveable(self, state: str) -> tuple[str, ...]:
        """All things that can be taken."""
        known = self._ask(wm.MoveableObjects(state=state), wm.Objects)
        return tuple(one.id for one in known.objects)

    def beside(self, state: str, name: str) -> list[str]:
        """What stands near the thing and can be taken, nearest first; nothing that the plan itself
        put there.
        """
        others = self._near(state, name, BESIDE_M, LEVEL_M)
        return [one for one in others if self.holder(state, one) is None and self.exact(state, one)]

    def _near(self, state: str, name: str, radius: float, height: float) -> list[str]:
        """The other moveable things within a distance and a difference of height [m], nearest
        first.
        """
        poses = {
            one: self._ask(wm.ObjectPose(state=state, object=one), wm.PoseOf).pose
            for one in self.moveable(state)
        }
        at = {one: np.array(pose.xyz) for one, pose in poses.items()}
        if name not in at:
            return []
        away = {one: xyz - at[name] for one, xyz in at.items() if one != name}
        distance = {
            one: float(np.hypot(x, y)) for one, (x, y, z) in away.items() if abs(z) < height
        }
        close = (one for one, far in distance.items() if far < radius)
        return sorted(close, key=distance.__getitem__)

    def origin(self, state: str, name: str) -> wm.PoseOf:
        """Where the thing stood before it was taken."""
        return self._ask(wm.ObjectOrigin(state=state, object=name), wm.PoseOf)

    def container(self, state: str, name: str) -> bool:
        """Whether something can be put into the thing."""
        return self._true(state, wm.Relation.IS_INSTANCE_OF, name, "Container")

    def filled(self, state: str, name: str) -> bool:
        """Whether something was poured into the thing."""
        return any(
            self._true(state, wm.Relation.IS_IN, f"{one}.content", name)
            for one in self.moveable(state)
        )

    def at(self, state: str, name: str, where: str) -> bool:
        """Whether the thing stands on or in the place already, or where it stood before it was
        taken.
        """
        here = self._ask(wm.ObjectPose(state=state, object=name), wm.PoseOf)
        if where == BACK:
            return (
                here.held_by is None
                and math.dist(here.pose.xyz, self.origin(state, name).pose.xyz) < SAME_PLACE_M
            )
        return here.on in self.places(state, where) and self.container(
            state, here.on
        ) == self.inside(state, name)

    def fallen(self, state: str, name: str) -> Fact | None:
        """How the thing lies that does not stand; None for one that stands."""
        return fallen(
            name, transform(self._ask(wm.ObjectPose(state=state, object=name), wm.PoseOf).pose)
        )

    def inside(self, state: str, name: str) -> bool:
        """Whether the thing stands inside another one, so that it must come out before anything is
        poured into it.
        """
        on = self.support(state, name)
        return bool(on) and self._true(state, wm.Relation.IS_IN, name, on)

    def looked_into(self, state: str, name: str) -> bool:
        """Whether the thing stands so low that the eyes look into its opening."""
        hole = self._ask(wm.ObjectHole(state=state, object=name), wm.Hole)
        at = transform(self._ask(wm.ObjectPose(state=state, object=name), wm.PoseOf).pose)
        return looked_into(*at.act(np.array(hole.centre)))

    def exact(self, state: str, name: str) -> bool:
        """Whether the thing was seen where it stands, not only predicted to stand there."""
        return self._true(state, wm.Relation.HAS_EXACT_POSE, name)

    def _true(self, state: str, relation: str, subject: str, value: str = "") -> bool:
        query = wm.Holds(state=state, relation=relation, subject=subject, value=value)
        return self._ask(query, wm.Truth).value


def fallen(name: str, pose: pin.SE3) -> Fact | None:
    """How a thing in this pose lies that does not stand; None for one that stands."""
    if not lies(pose):
        return None
    return fact(Kind.UPSIDE_DOWN if upside_down(pose) else Kind.LIES, name)


# --- What methods of tasks decide by --------------------------------------------------------------


OTHER = {Side.LEFT: Side.RIGHT, Side.RIGHT: Side.LEFT}

Subtasks = list[tuple[Any, ...]]
"""Tasks and actions by their names, with arguments, in order. Those of other tasks are named too,
never imported.
"""


@dataclass
class Known:
    """Queries to km and the facts made of them.

    `why`: reasons why a task or step cannot be done, newest last. `not_now`: why the method that
    was tried last does not apply.
    """

    ask: Asking
    facts: StateFacts = field(init=False)
    why: list[Facts] = field(init=False, default_factory=list)
    not_now: Facts = field(init=False, default=())

    def __post_init__(self) -> None:
        self.facts = StateFacts(self.ask)

    def failed(self, *why: Fact) -> None:
        """Note why something cannot be done at all: the person is told if there is no plan."""
        self.why.append(why)

    def unfit(self, *why: Fact) -> Subtasks | None:
        """Return None, with the note why this method does not apply: another one may."""
        self.not_now = why
        return None


def away(known: Known, state: str) -> list[Side]:
    """The sides of empty arms that are not at home."""
    full_or_home = known.facts.in_hand, known.facts.at_home
    return [side for side in Side if not any(is_so(state, side) for is_so in full_or_home)]
