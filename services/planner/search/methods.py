"""The methods of the planning domain: from task and facts of a state to subtasks, or None if it does not apply.

Methods follow the published domain of the same group (proghtn-backstream@019fd34: pour, pourAt, takeSd, place, lookAt),
with the source taken first, as in the paper's plan #1. Arguments are the id of the state at km, then those of the
task. All facts come from km; a method raises Unanswered if km does not know one. Must not know: geometry.
"""

from collections.abc import Callable
from typing import Any

from companion.languages.facts import Fact, Kind, fact
from companion.languages.hfsm import TaskName
from companion.languages.values import Side
from services.planner.search.facts import Facts

TABLE, CABINET = "table", "cabinet"  # classes of the ontology, in small letters as in a task
OTHER = {Side.LEFT: Side.RIGHT, Side.RIGHT: Side.LEFT}

Subtasks = list[tuple[Any, ...]]


class Methods:
    """Methods over the facts of km; `failed` notes a reason why a task cannot be done at all.

    `unfit`: why the method that was tried last does not apply.
    """

    def __init__(self, facts: Facts, failed: Callable[[Fact], None]) -> None:
        self.facts, self.failed = facts, failed
        self.unfit: tuple[Fact, ...] = ()

    def _not(self, *why: Fact) -> Subtasks | None:
        self.unfit = why
        return None

    def pour_held(self, km: str, source: str, destination: str) -> Subtasks | None:
        """Tilt a source that is held over a destination that stands free and was seen there."""
        side = self.facts.holder(km, source)
        if not side:
            return self._not(fact(Kind.NO_HAND_HOLDS, source))
        return [("a_pour", source, destination, side)] if self._open(km, destination) else None

    def pour_into_standing(self, km: str, side: Side, source: str, destination: str) -> Subtasks | None:
        """Take the source and tilt it over a destination that stands free and was seen there."""
        if holder := self.facts.holder(km, source):
            return self._not(fact(Kind.HOLDS, holder, source))
        if not self._open(km, destination):
            return None
        return [(TaskName.TAKE, source, side), ("a_pour", source, destination, side)]

    def pour_into_held(self, km: str, source: str, destination: str) -> Subtasks | None:
        """Put a destination that is held down, look at it, plan again."""
        if self.facts.holder(km, destination) is None:
            return self._not(fact(Kind.NO_HAND_HOLDS, destination))
        return [("set_down", destination), ("localize", destination)]

    def pour_into_unseen(self, km: str, source: str, destination: str) -> Subtasks | None:
        """Look at a destination that was put down and not seen since, plan again."""
        if holder := self.facts.holder(km, destination):
            return self._not(fact(Kind.HOLDS, holder, destination))
        if self.facts.exact(km, destination):
            return self._not(fact(Kind.SEEN_WHERE_IT_STANDS, destination))
        return [("localize", destination)]

    def pour_taking_both(self, km: str, first: Side, source: str, destination: str) -> Subtasks | None:
        """Take the source with one hand and the destination with the other, then put the destination down."""
        if holder := self.facts.holder(km, destination):
            return self._not(fact(Kind.HOLDS, holder, destination))
        if not self.facts.inside(km, destination):
            return self._not(fact(Kind.STANDS_FREE, destination))
        if (holder := self.facts.holder(km, source)) not in (None, first):
            return self._not(fact(Kind.HOLDS, holder, source))
        return [
            (TaskName.TAKE, source, first),
            ("a_carry", first),
            (TaskName.TAKE, destination, OTHER[first]),
            ("set_down", destination),
            ("localize", destination),
        ]

    def pour_taken_again(self, km: str, hand: Side, source: str, destination: str) -> Subtasks | None:
        """Put the source down, and take it with this hand by another grasp: as it is held it cannot be tilted there."""
        holder = self.facts.holder(km, source)
        if holder is None:
            return self._not(fact(Kind.NO_HAND_HOLDS, source))
        if hand is not holder and (held := self.facts.in_hand(km, hand)):
            return self._not(fact(Kind.HOLDS, hand, held))
        if not self._open(km, destination):
            return None
        taken = [(TaskName.TAKE, source, hand), ("a_pour", source, destination, hand)]
        return [("set_down", source), ("a_look", source), *taken]

    def _open(self, km: str, name: str) -> bool:
        """Whether the thing was seen where it stands, and is not inside another one."""
        if holder := self.facts.holder(km, name):
            self._not(fact(Kind.HOLDS, holder, name))
        elif self.facts.inside(km, name):
            self._not(fact(Kind.INSIDE_ANOTHER, name))
        elif not self.facts.exact(km, name):
            self._not(fact(Kind.PUT_DOWN_UNSEEN, name))
        else:
            return True
        return False

    def take_nothing(self, km: str, name: str, side: str) -> Subtasks | None:
        """Do nothing where the wanted hand holds it already."""
        holder = self.facts.holder(km, name)
        if holder is None:
            return self._not(fact(Kind.NO_HAND_HOLDS, name))
        if side not in ("", holder):
            return self._not(fact(Kind.HOLDS, holder, name), fact(Kind.OTHER_HAND_WANTED, side))
        return []

    def take_over(self, km: str, name: str, side: str) -> Subtasks | None:
        """Put down what the other hand holds, look at it, plan again."""
        holder = self.facts.holder(km, name)
        if holder is None:
            return self._not(fact(Kind.NO_HAND_HOLDS, name))
        if side in ("", holder):
            return self._not(fact(Kind.HOLDS, holder, name))
        return [("set_down", name), ("localize", name)]

    def take_with(self, km: str, hand: Side, name: str, side: str) -> Subtasks | None:
        """Take it with this hand, if it is empty and wanted."""
        if side not in ("", hand):
            return self._not(fact(Kind.OTHER_HAND_WANTED, side))
        if holder := self.facts.holder(km, name):
            return self._not(fact(Kind.HOLDS, holder, name))
        if held := self.facts.in_hand(km, hand):
            self.failed(fact(Kind.HOLDS, hand, held))
            return None
        return [("a_take", name, hand)]

    def bring_with(self, km: str, hand: Side, name: str, side: str) -> Subtasks | None:
        """Take it with this hand, if it is wanted and no other one holds it, and hold it over a place on a table."""
        if side not in ("", hand):
            return self._not(fact(Kind.OTHER_HAND_WANTED, side))
        holder = self.facts.holder(km, name)
        if holder is None:
            other = self.facts.in_hand(km, hand)
            return self._not(fact(Kind.HOLDS, hand, other)) if other else [("hold_out", name, hand)]
        if holder is hand:
            return [("a_offer", hand)]
        return [(TaskName.TAKE, name, hand)] if side else self._not(fact(Kind.HOLDS, holder, name))

    def hold_out_at_try(self, km: str, number: str, name: str, hand: Side) -> Subtasks | None:
        """Take it by some grasp, from which it can be held over a place: not every one leaves a way there."""
        return [("a_take", name, hand, number), ("a_offer", hand)]

    def swap_hands(self, km: str, name: str) -> Subtasks | None:
        """Put down what is held, look at it, take it with the other hand to where that one could put it down."""
        held = {side: thing for side in OTHER if (thing := self.facts.in_hand(km, side)) and name in ("", thing)}
        if len(held) != 1:
            none = fact(Kind.NO_HAND_HOLDS, name) if name else fact(Kind.HANDS_EMPTY)
            self.failed(fact(Kind.HANDS_FULL) if held else none)
            return None
        ((side, thing),) = held.items()
        if other := self.facts.in_hand(km, OTHER[side]):
            self.failed(fact(Kind.HOLDS, OTHER[side], other))
            return None
        return [("set_down", thing), ("a_look", thing), ("hold_out", thing, OTHER[side])]

    def put_down(self, km: str, name: str) -> Subtasks | None:
        """Put it down and look at it; where it stands already, as after a way that was blocked, bring the hand home."""
        if self.facts.holder(km, name):
            return [("set_down", name), ("a_look", name)]
        if self.facts.support(km, name) and self._away(km) and not self.facts.fallen(km, name):
            return self._home_and_look(km, name)
        self.failed(fact(Kind.NO_HAND_HOLDS, name))
        return None

    def put_down_lying_with(self, km: str, hand: Side, name: str) -> Subtasks | None:
        """Take a thing with this hand that fell over, and put it down upright."""
        if self.facts.holder(km, name) or not self.facts.fallen(km, name):
            return self._not(fact(Kind.DID_NOT_FALL, name))
        if held := self.facts.in_hand(km, hand):
            return self._not(fact(Kind.HOLDS, hand, held))
        return [("a_take", name, hand), ("set_down", name), ("a_look", name)]

    def set_down(self, km: str, name: str) -> Subtasks | None:
        """Put it down, and bring the hand home; whoever needs it there looks at it."""
        side = self.facts.holder(km, name)
        return [("a_place", side), ("a_home", side)] if side else self._not(fact(Kind.NO_HAND_HOLDS, name))

    def _away(self, km: str) -> list[Side]:
        """Return the sides of empty arms that are not at home."""
        return [side for side in Side if not self.facts.in_hand(km, side) and not self.facts.at_home(km, side)]

    def put_at_nothing(self, km: str, name: str, where: str) -> Subtasks | None:
        """Only look at it where it stands there already, with empty hands at home: one may have left it leaning."""
        if holder := self.facts.holder(km, name):
            return self._not(fact(Kind.HOLDS, holder, name))
        if self.facts.at(km, name, where):
            how = self.facts.fallen(km, name)
            return self._not(how) if how else self._home_and_look(km, name)
        return self._not(fact(Kind.STANDS_ELSEWHERE, name))

    def _home_and_look(self, km: str, name: str) -> Subtasks:
        return [*(("a_home", side) for side in self._away(km)), ("a_look", name)]

    def put_at_held(self, km: str, name: str, where: str) -> Subtasks | None:
        """Put it there with the hand that holds it, bring that one home, and look at it."""
        side = self.facts.holder(km, name)
        after = (("a_home", side), ("a_look", name))
        return [("a_place", side, where), *after] if side else self._not(fact(Kind.NO_HAND_HOLDS, name))

    def put_at_with(self, km: str, hand: Side, name: str, where: str) -> Subtasks | None:
        """Take it with this hand, if it is empty, and put it there."""
        if holder := self.facts.holder(km, name):
            return self._not(fact(Kind.HOLDS, holder, name))
        if held := self.facts.in_hand(km, hand):
            self.failed(fact(Kind.HOLDS, hand, held))
            return None
        return [("set_at", name, hand, where)]

    def set_at_try(self, km: str, number: str, name: str, hand: Side, where: str) -> Subtasks | None:
        """Take it by some grasp, from which it can be put there: not every one leaves a way."""
        return [("a_take_to", name, hand, number, where), ("a_place", hand, where), ("a_home", hand), ("a_look", name)]

    def clear_nothing(self, km: str) -> Subtasks | None:
        """Do nothing where no thing that can be taken stands on a table, and say so."""
        if self._on_tables(km):
            return self._not(fact(Kind.SOMETHING_ON_A_TABLE))
        return [("a_tell", fact(Kind.NOTHING_ON_A_TABLE))]

    def clear_things(self, km: str) -> Subtasks | None:
        """Put one thing after the other into the cabinet, as far as that is possible."""
        things = self._on_tables(km)
        if not things:
            return self._not(fact(Kind.NOTHING_ON_A_TABLE))
        return [*(("clear_away", name) for name in things), ("a_some_done",)]

    def clear_into_cabinet(self, km: str, name: str) -> Subtasks | None:
        """Put it into the cabinet."""
        return [(TaskName.PUT_AT, name, CABINET)]

    def clear_not(self, km: str, name: str) -> Subtasks | None:
        """Leave it, and say so."""
        return [("a_stays", name)]

    def _on_tables(self, km: str) -> list[str]:
        tables = self.facts.places(km, TABLE)
        return [name for name in self.facts.moveable(km) if self.facts.support(km, name) in tables]

    def after_arms_home(self, km: str, task: str, arguments: tuple[str, ...]) -> Subtasks | None:
        """Bring empty arms home, then do the task: after an interrupted act one may be in the way, in a cabinet say."""
        away = self._away(km)
        if not away:
            return self._not(fact(Kind.ARMS_HOME))
        return [*(("a_home", side) for side in away), (task, *arguments)]

    def after_clearing(self, km: str, number: int, task: str, arguments: tuple[str, ...]) -> Subtasks | None:
        """Put the n-th nearest thing beside the wanted one aside, then do the task."""
        name = arguments[0]
        if holder := self.facts.holder(km, name):
            return self._not(fact(Kind.HOLDS, holder, name))
        near = self.facts.beside(km, name)
        if len(near) < number:
            few = fact(Kind.FEWER_BESIDE, name, number) if near else fact(Kind.NOTHING_BESIDE, name)
            return self._not(few)
        return [("a_in_the_way", name, *near), ("put_aside", near[number - 1]), (task, *arguments)]

    def after_opening(self, km: str, number: int, task: str, arguments: tuple[str, ...]) -> Subtasks | None:
        """Open the n-th closed door of the furniture in which its things stand, look at the first thing, plan again.

        The leaf then is where it is seen, not where the plan turns it.
        """
        doors = self.facts.closed_doors(km)
        if not doors:
            return None
        inside = [one for one in self._things(task, arguments) if not self.facts.holder(km, one)]
        around = {self.facts.support(km, one) for one in inside if self.facts.inside(km, one)}
        shut = [(door, body) for door, body in doors if body in around]
        if len(shut) < number:
            return self._not(fact(Kind.FEWER_DOORS, number))
        return [("open_door", *shut[number - 1]), ("localize", arguments[0])]

    def _things(self, task: str, arguments: tuple[str, ...]) -> tuple[str, ...]:
        """Return the arguments of a task that are things: both of a pour, else the first."""
        return arguments if task == TaskName.POUR else arguments[:1]

    def open_door_with(self, km: str, hand: Side, door: str, around: str) -> Subtasks | None:
        """Open it with this hand, and bring that one home."""
        return [("a_open", door, around, hand), ("a_home", hand)]

    def put_aside_with(self, km: str, hand: Side, name: str) -> Subtasks | None:
        """Take it with this hand, if it is empty, put it down where there is room, and bring the hand home."""
        if held := self.facts.in_hand(km, hand):
            return self._not(fact(Kind.HOLDS, hand, held))
        return [("a_take", name, hand), ("a_place", hand), ("a_home", hand)]

    def localize(self, km: str, name: str) -> Subtasks | None:
        """Look at it; the rest needs a new plan."""
        return [("a_look", name), ("a_replan", name)]

    def look_around(self, km: str) -> Subtasks | None:
        """Look around; always applicable."""
        return [("a_look_around",)]
