"""A search that knows its plans by heart and still asks km for every fact they rest on.

It stands in the place of the planner's child process (the same words): the agent forwards its queries, is cancelled
and begins again as with the true one. The plans have the shape of the true ones: take both, put the bowl down, look,
Replan; then pour.
"""

from collections.abc import Generator

from agent_runtime.io.devices import Post
from companion.languages import hfsm, rc, wm
from companion.languages.facts import Kind, fact
from companion.languages.values import Pose, Side
from services.planner.local import Answer, Ask, Begin, Found, NotFound, Stop

Searching = Generator[wm.AnyQuery, wm.AnyAnswer, hfsm.HierarchicalPlan | str]
OK, REPLAN = hfsm.Outcome.SUCCEEDED, hfsm.Outcome.REPLAN
HERE = Pose((0.0, 0.0, 0.0))
THINK_S = 0.02
PLACE = Pose((0.8, 0.0, 0.9))


class Script:
    """The device; `asked` counts queries of all searches."""

    busy = False

    def __init__(self, post: Post, asked: list[wm.AnyQuery]) -> None:
        self._post, self._asked = post, asked
        self._attempt, self._work = 0, None

    def tell(self, content: object) -> None:
        """Begin, go on, or stop."""
        match content:
            case Begin(attempt=attempt, network=network):
                self._attempt, self._work = attempt, pour(network)
                self._go_on(None)
            case Answer(attempt=attempt, answer=answer) if attempt == self._attempt and self._work is not None:
                self._go_on(answer)
            case Stop():
                self._work = None

    def close(self) -> None:
        """Killed."""
        self._work = None

    def _go_on(self, answer: wm.AnyAnswer | None) -> None:
        assert self._work is not None
        try:
            query = next(self._work) if answer is None else self._work.send(answer)
        except StopIteration as stop:
            found = stop.value
            word = NotFound(self._attempt, found) if isinstance(found, tuple) else Found(self._attempt, found)
            self._post(word, THINK_S)
            return
        self._asked.append(query)
        self._post(Ask(self._attempt, query), THINK_S)


def pour(network: hfsm.GroundTaskNetwork) -> Searching:
    """The plan that fits the world as km tells it."""
    if network.tasks[0].name == "look_around":
        return plan_of(network, [("look around", [look("jar_1")])])
    known = yield wm.ListObjects()
    if isinstance(known, wm.Unknown):
        return known.why
    names = {one.id for one in known.objects} if isinstance(known, wm.Objects) else set()
    if not {"jar_1", "bowl_1"} <= names:
        return (fact(Kind.NOT_SEEN, "jar"), fact(Kind.SEEN, *sorted(names)) if names else fact(Kind.SEEN_NOTHING))
    state = ""
    for number in range(4):  # a chain of hypotheses, each asked something
        made = yield wm.HypotheticalState(state=state, id=f"{network.id}/{number}")
        assert isinstance(made, wm.Made), made
        state = made.id
        yield wm.ObjectPose(state=state, object="jar_1")
    jar = yield wm.CurrentGrasp(object="jar_1")
    bowl = yield wm.CurrentGrasp(object="bowl_1")
    where = yield wm.ObjectPose(object="bowl_1")
    assert isinstance(jar, wm.GraspOf)
    assert isinstance(bowl, wm.GraspOf)
    assert isinstance(where, wm.PoseOf)
    return plan_of(network, steps(jar.side, bowl.side, where))


def steps(jar: Side | None, bowl: Side | None, where: wm.PoseOf) -> list[tuple[str, list[rc.Act]]]:
    """Return the steps still to be done."""
    todo: list[tuple[str, list[rc.Act]]] = []
    if jar is None:
        todo.append(("take jar_1", [move(Side.LEFT), grasp(Side.LEFT, "jar_1")]))
    if bowl is None and where.exact and where.pose.xyz == PLACE.xyz:
        tilt = rc.Pour("", Side.LEFT, "jar_1", "bowl_1", 0.0, 0.0, (0.5, 2.0), 1.0, 0.1)
        return [*todo, ("pour jar_1 bowl_1", [move(Side.LEFT), tilt])]
    if bowl is None:
        todo.append(("take bowl_1", [move(Side.RIGHT), grasp(Side.RIGHT, "bowl_1")]))
    release = rc.Release("", Side.RIGHT, "bowl_1", "table_1", PLACE, ())
    return [*todo, ("put bowl_1 down", [release]), ("look at bowl_1", [look("bowl_1")])]


def move(side: Side) -> rc.MoveJoint:
    """A free motion."""
    return rc.MoveJoint("", side, ((0.0,) * 8,), 0.3)


def grasp(side: Side, name: str) -> rc.Grasp:
    """Take it."""
    return rc.Grasp("", side, name, "g", (rc.ApproachPoint(HERE, 0.5),), 0.1, 0.3, 0.2)


def release(key: str, side: Side, name: str) -> rc.Release:
    """Put it down wherever there is room."""
    return rc.Release(key, side, name, "table_1", None, ())


def look(name: str) -> rc.Look:
    """Look at it."""
    return rc.Look("", ((1.0, 0.0, 1.0),))


def plan_of(network: hfsm.GroundTaskNetwork, todo: list[tuple[str, list[rc.Act]]]) -> hfsm.HierarchicalPlan:
    """Steps chained; a plan without a pour ends in Replan once the bowl is localized."""
    machines = [machine(network.id, number, name, acts) for number, (name, acts) in enumerate(todo)]
    states: list[hfsm.State] = list(machines)
    if todo[-1][0].startswith("look at"):
        query = wm.Holds(relation="hasExactPose", subject="bowl_1")
        states += [
            hfsm.AskState("is bowl_1 localized?", query),
            hfsm.EndState("replan", REPLAN, (fact(Kind.LOCALIZED, "bowl_1"),)),
        ]
    chained = chain(states)
    root = hfsm.Machine(network.tasks[0].name, chained[0].name, chained)
    return hfsm.HierarchicalPlan(network.id, network.tasks[0].name, root, 4.0 * len(todo), 12)


def machine(plan: str, number: int, name: str, acts: list[rc.Act]) -> hfsm.Machine:
    """One step, with what puts everything down if it is cancelled."""
    keyed = [type(act)(**{**fields(act), "key": f"{plan}/{number}.{k}"}) for k, act in enumerate(acts)]
    leaves = chain([hfsm.ActState(f"{type(act).__name__.lower()} {k}", act) for k, act in enumerate(keyed)])
    downs = [
        hfsm.ActState(
            f"put down {thing}", rc.Release(f"{plan}/{number}.safe-{thing}", side, thing, "table_1", None, ())
        )
        for side, thing in ((Side.RIGHT, "bowl_1"), (Side.LEFT, "jar_1"))
    ]
    safe = chain(list(downs))
    return hfsm.Machine(name, leaves[0].name, leaves, safe=hfsm.Machine("put down", safe[0].name, safe))


def fields(act: rc.Act) -> dict[str, object]:
    """The fields of a command."""
    return {name: getattr(act, name) for name in act.__struct_fields__}


def chain(states: list[hfsm.State]) -> tuple[hfsm.State, ...]:
    """Each leads to the next one."""
    from msgspec.structs import replace

    following = [*(state.name for state in states[1:]), ""]
    return tuple(
        state if isinstance(state, hfsm.EndState) or not name else replace(state, arcs=(hfsm.Arc(OK, name),))
        for state, name in zip(states, following, strict=True)
    )
