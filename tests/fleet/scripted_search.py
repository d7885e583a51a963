"""A search that knows its plans by heart and still asks km for every fact they rest on.

It stands in the place of the planner's child process (the same words): the agent forwards its
queries, is cancelled and begins again as with the true one. The plans have the shape of the true
ones: take both, put the bowl down, look, Replan; then pour.
"""

from collections.abc import Generator

from companion.languages import hfsm, rc, wm
from companion.languages.facts import Kind, fact
from companion.languages.values import Pose, Side
from companion.tasks.pour.done import Pour
from services.planner.search import Answer, Ask, Begin, Found, Stop

Searching = Generator[wm.AnyQuery, wm.AnyAnswer, hfsm.HierarchicalPlan | hfsm.NoPlan]
OK, REPLAN = hfsm.Outcome.SUCCEEDED, hfsm.Outcome.REPLAN
HERE = Pose((0.0, 0.0, 0.0))
THINK_S = 0.02
PLACE = Pose((0.8, 0.0, 0.9))


class Script:
    """The device; `asked` counts queries of all searches."""

    busy = False

    def __init__(self, post, asked):
        self._post, self._asked = post, asked
        self._attempt, self._work = 0, None

    def tell(self, content):
        """Begin, go on, or stop."""
        match content:
            case Begin(attempt=attempt, network=network):
                self._attempt, self._work = attempt, pour(network)
                self._go_on(None)
            case Answer(attempt=attempt, answer=answer) if (
                attempt == self._attempt and self._work is not None
            ):
                self._go_on(answer)
            case Stop():
                self._work = None

    def close(self):
        """Killed."""
        self._work = None

    def _go_on(self, answer):
        assert self._work is not None
        try:
            query = next(self._work) if answer is None else self._work.send(answer)
        except StopIteration as stop:
            self._post(Found(self._attempt, stop.value), THINK_S)
            return
        self._asked.append(query)
        self._post(Ask(self._attempt, query), THINK_S)


def pour(network):
    """The plan that fits the world as km tells it."""
    if network.tasks[0].name == "look_around":
        return plan_of(network, [(hfsm.Step("look-around"), [look("jar_1")])])
    known = yield wm.ListObjects()
    if isinstance(known, wm.Unknown):
        return hfsm.NoPlan(network.id, known.why)
    names = {one.id for one in known.objects} if isinstance(known, wm.Objects) else set()
    if not {"jar_1", "bowl_1"} <= names:
        seen = fact(Kind.SEEN, *sorted(names)) if names else fact(Kind.SEEN_NOTHING)
        return hfsm.NoPlan(network.id, (fact(Kind.NOT_SEEN, "jar"), seen))
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


def steps(jar, bowl, where):
    """Return the steps still to be done."""
    todo = []
    if jar is None:
        todo.append((hfsm.Step("take", ("jar_1",)), [move(Side.LEFT), grasp(Side.LEFT, "jar_1")]))
    if bowl is None and where.exact and where.pose.xyz == PLACE.xyz:
        tilt = Pour("", Side.LEFT, "jar_1", "bowl_1", 0.0, 0.0, (0.5, 2.0), 1.0, 0.1)
        return [*todo, (hfsm.Step("pour", ("jar_1", "bowl_1")), [move(Side.LEFT), tilt])]
    if bowl is None:
        taken = [move(Side.RIGHT), grasp(Side.RIGHT, "bowl_1")]
        todo.append((hfsm.Step("take", ("bowl_1",)), taken))
    release = rc.Release("", Side.RIGHT, "bowl_1", "table_1", PLACE, ())
    sees = (hfsm.Step("look-at", ("bowl_1",)), [look("bowl_1")])
    return [*todo, (hfsm.Step("place", ("bowl_1",)), [release]), sees]


def move(side):
    """A free motion."""
    return rc.MoveJoint("", side, ((0.0,) * 8,), 0.3)


def grasp(side, name):
    """Take it."""
    return rc.Grasp("", side, name, "g", (rc.ApproachPoint(HERE, 0.5),), 0.1, 0.3, 0.2)


def release(key, side, name):
    """Put it down wherever there is room."""
    return rc.Release(key, side, name, "table_1", None, ())


def look(name):
    """Look at it."""
    return rc.Look("", ((1.0, 0.0, 1.0),))


def plan_of(network, todo):
    """Steps chained; a plan without a pour ends in Replan once the bowl is localized."""
    machines = [machine(network.id, number, step, acts) for number, (step, acts) in enumerate(todo)]
    states = list(machines)
    if todo[-1][0].does == "look-at":
        query = wm.Holds(relation="hasExactPose", subject="bowl_1")
        end = hfsm.EndState("replan", REPLAN, (fact(Kind.LOCALIZED, "bowl_1"),))
        states += [hfsm.AskState("localize bowl_1", query), end]
    chained = chain(states)
    root = hfsm.Machine(network.tasks[0].name, chained[0].name, chained)
    return hfsm.HierarchicalPlan(network.id, network.tasks[0].name, root, 4.0 * len(todo), 12)


def machine(plan, number, step, acts):
    """One step, with what puts everything down if it is cancelled."""
    keyed = [
        type(act)(**{**fields(act), "key": f"{plan}/{number}.{k}"}) for k, act in enumerate(acts)
    ]
    leaves = chain(
        [hfsm.ActState(f"{type(act).__name__.lower()} {k}", act) for k, act in enumerate(keyed)]
    )
    held = ((Side.RIGHT, "bowl_1"), (Side.LEFT, "jar_1"))
    keys = {thing: f"{plan}/{number}.safe-{thing}" for _, thing in held}
    releases = (rc.Release(keys[thing], side, thing, "table_1", None, ()) for side, thing in held)
    downs = [hfsm.ActState(f"put down {one.object}", one) for one in releases]
    safe = chain(list(downs))
    name = " ".join((step.does.replace("-", " "), *step.things))
    down = hfsm.Step("put-everything-down")
    secured = hfsm.Machine("put down", safe[0].name, safe, step=down)
    return hfsm.Machine(name, leaves[0].name, leaves, safe=secured, step=step)


def fields(act):
    """The fields of a command."""
    return {name: getattr(act, name) for name in act.__struct_fields__}


def chain(states):
    """Each leads to the next one."""
    from msgspec.structs import replace

    following = [*(state.name for state in states[1:]), ""]
    return tuple(
        state
        if isinstance(state, hfsm.EndState) or not name
        else replace(state, arcs=(hfsm.Arc(OK, name),))
        for state, name in zip(states, following, strict=True)
    )
