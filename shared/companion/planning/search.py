"""The search as one function: from a task network, and a function that asks km, to a plan or the reason for none."""

from collections.abc import Callable
from functools import cache

from msgspec.structs import replace

from companion.languages import hfsm, wm
from companion.languages.cmd import BACK
from companion.languages.facts import Fact, Kind, fact, fitting
from companion.languages.values import Side
from companion.planning import assembling
from companion.planning.asking import Asking, Unanswered
from companion.planning.engine import ROWS, Search, merged
from companion.planning.looking import look_for
from companion.planning.methods import StateFacts
from companion.planning.registry import Argument, tasks
from companion.planning.steps import Geometry
from velma.kinematics.robot import Robot

REFUSED = merged([row.refused for row in ROWS])
REASONS, LARGEST = 3, 500  # the newest ones that are told, and their bytes: a report has room for no more (estimates)


class NotSeen(Unanswered):
    """km knows of no thing for a word."""

    def __init__(self, word: str, why: Unanswered) -> None:
        self.word = word
        super().__init__(why.query, why.why)


class NotATask(Exception):
    """The network names a task that the domain does not have."""

    def __init__(self, why: Fact) -> None:
        self.why = (why,)
        super().__init__(why.kind)


def search(
    network: hfsm.GroundTaskNetwork, ask: Callable[[wm.AnyQuery], wm.AnyAnswer], seed: int
) -> hfsm.HierarchicalPlan | hfsm.NoPlan:
    """Return a plan, or NoPlan. All facts come through `ask`. Deterministic for a seed: limits count iterations.

    Where a thing has not been seen, it is a plan to look for it, and to plan again.
    """
    asking = Asking(ask, network.id)
    geometry = Geometry(asking, _robot(), seed)
    try:
        todo = [_ground(asking, task) for task in network.tasks]
        start = asking.suppose("", ())
        searching = Search(geometry)
        found = searching.run(todo, start)
    except NotSeen as unseen:
        found = _revealed(geometry, unseen.word)
        found = found or assembling.Found([look_for(unseen.word)], unseen.word, (), hfsm.Outcome.FAILED)
        name = f"look for {unseen.word}"
        return assembling.plan(network.id, name, found, asking.queries, assembling.held_at(asking, ""))
    except (Unanswered, NotATask) as refused:
        return hfsm.NoPlan(network.id, refused.why)
    if found is None:
        return hfsm.NoPlan(network.id, _newest(geometry.why), rejected=searching.rejected)
    held = assembling.held_at(asking, start)
    name = "; ".join(" ".join(task) for task in todo)
    plan = assembling.plan(network.id, name, found, asking.queries, held)
    return replace(plan, rejected=searching.rejected)


def _revealed(geometry: Geometry, word: str) -> assembling.Found | None:
    """Return the first plan that may bring a thing into sight that was never seen; None where there is none.

    Whether it is seen then or not, the task is planned again.
    """
    try:
        start = geometry.ask.suppose("", ())
        for todo in (todo for row in ROWS if row.reveals for todo in row.reveals(geometry, start)):
            if found := Search(geometry).run(todo, start):
                return found._replace(sought=word, otherwise=hfsm.Outcome.REPLAN)
    except Unanswered:
        pass  # with what is not known nothing is done
    return None


@cache
def _robot() -> Robot:
    """Return the robot, read once in a process: that takes 12 ms, with the shapes for its collision world."""
    return Robot()


def _ground(asking: Asking, task: hfsm.Task) -> tuple[str, ...]:
    """Return the task with the ids of km in place of words for things: "jar" -> "jar_1"."""
    kinds = tasks().get(task.name)
    if kinds is None or len(kinds) != len(task.arguments):
        raise NotATask(fact(Kind.NOT_A_TASK, task.name))
    arguments = tuple(_WORDS[kind](asking, word) for kind, word in zip(kinds, task.arguments, strict=True))
    if task.name in REFUSED and (why := REFUSED[task.name](*arguments)):
        raise NotATask(why)
    return (task.name, *arguments)


def _thing(asking: Asking, word: str) -> str:
    """Return the first thing that km knows by this id or kind; "" stays. Raise NotSeen with km's reason."""
    if not word:
        return word
    things = asking(wm.ListObjects(), wm.Objects).objects
    for thing in things:
        if word in (thing.id, thing.kind.lower()):
            return thing.id
    try:
        return asking(wm.ObjectPose(object=word), wm.PoseOf).object
    except Unanswered as why:
        raise NotSeen(word, why) from why


def _side(asking: Asking, word: str) -> str:
    """Return a word for a hand, "" for any."""
    if word not in ("", *Side):
        raise NotATask(fact(Kind.NOT_A_HAND, word))
    return word


def _place(asking: Asking, word: str) -> str:
    """Return a word for places that km knows; the steps choose one of them."""
    facts = StateFacts(asking)
    if word != BACK and not facts.places("", word):
        seen = sorted(facts.places("", "furniture"))
        others = (fact(Kind.SEEN, *seen),) if seen else ()
        raise Unanswered(wm.StaticObjects(), (fact(Kind.NOT_A_PLACE, word), *others))
    return word


_WORDS: dict[Argument, Callable[[Asking, str], str]] = {
    Argument.THING: _thing,
    Argument.SIDE: _side,
    Argument.PLACE: _place,
}


def _newest(why: list[tuple[Fact, ...]]) -> tuple[Fact, ...]:
    """Return the different reasons of the failed attempts, last first."""
    different = list(dict.fromkeys(reversed(why)))[:REASONS]
    return fitting(tuple(one for some in different for one in some), LARGEST) or (fact(Kind.NO_METHOD),)
