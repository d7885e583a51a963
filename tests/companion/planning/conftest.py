"""km's memory filled through the receptor on the canonical scene, and what it is after each step of the first plan.

A step is not carried out here: what the plan supposes of its end is taken for observed.
"""

from collections.abc import Callable
from functools import cache

import pytest
from msgspec.structs import replace

from companion.languages import hfsm, wm
from companion.languages.facts import Kind, fact
from companion.languages.values import BodyPosture, Pose, Side
from companion.planning.search import search
from companion.skills.motions import aim
from services.executor import simulation
from services.knowledge import answers
from services.knowledge.observe import observed
from services.knowledge.overlays import Overlays
from services.knowledge.scene import Scene
from services.knowledge.store import Store
from services.task.outgoing_messages import SURVEY
from velma import names
from velma.kinematics.frames import xyz_quat
from velma.model import scene as model
from velma.sim.mujoco_backend import MujocoBackend

SEED = 7


class Km:
    """Answers as km does, writes down what was asked, and knows nothing of what `starved` says yes to."""

    def __init__(self, scene: Scene, starved: Callable[[wm.AnyQuery], bool] = lambda query: False) -> None:
        self.scene, self.overlays, self.starved = scene, Overlays(), starved
        self.asked: list[wm.AnyQuery] = []

    def ask(self, query: wm.AnyQuery) -> wm.AnyAnswer:
        """The answer; Unknown to what km is starved of."""
        self.asked.append(query)
        if self.starved(query):
            return wm.Unknown((fact(Kind.UNKNOWN_TO_KM, type(query).__name__),))
        self.overlays, answer = answers.ask(self.scene, self.overlays, query)
        return answer

    def plan(self, *task: str, request: str = "p1", seed: int = SEED) -> hfsm.HierarchicalPlan | hfsm.NoPlan:
        """Return the search's result for a task."""
        return search(hfsm.GroundTaskNetwork(request, (hfsm.Task(task[0], task[1:]),)), self.ask, seed)

    def believed(self, number: int) -> Scene:
        """The scene once the hypothetical state with this number was observed to be so."""
        supposed = list(self.overlays.states.values())[number].scene
        scene, joints = self.scene, supposed.joints
        told: list[wm.AnyObservation] = [
            wm.SeenBody(BodyPosture(joints["torso"][0], *(joints[part] for part in PARTS))),
            *(wm.SeenHand(side, held.object, held.grasp, held.pose) for side, held in supposed.hands.items()),
            *(wm.SeenObject(t.id, t.model, t.pose, 2.0) for t in supposed.things.values() if not supposed.holder(t.id)),
        ]
        for count, observation in enumerate(told):
            scene = observed(scene, observation, (2, count), 2.0)
        return scene


PARTS = ("right_arm", "left_arm", "head", "right_hand", "left_hand")


def steps(plan: hfsm.HierarchicalPlan | hfsm.NoPlan) -> list[str]:
    """Names of the states of a plan."""
    assert isinstance(plan, hfsm.HierarchicalPlan), plan.why
    return [state.name for state in plan.root.states]


def surveyed(scene: model.Scene) -> Scene:
    """Return km's scene when the robot stands in its start posture and has looked around, with the receptor's noise."""
    backend, eye, models = MujocoBackend(scene), simulation.receptor(scene), simulation.things(scene)
    qpos, store = backend.configuration().copy(), Store.open()
    told: list[wm.AnyObservation] = []
    for point in SURVEY.at:
        goal = aim(0.0, point)
        for name, angle in zip(names.HEAD, (goal.pan, goal.tilt), strict=True):
            qpos[backend.model.joint(name).qposadr[0]] = angle
        seen = eye.look(qpos)
        told += [wm.SeenObject(s.name, models[s.name], Pose(*xyz_quat(s.T_world_object)), 1.0) for s in seen]
    right, left = (tuple(float(x) for x in names.START[names.ARM[side]]) for side in ("right", "left"))
    told.append(wm.SeenBody(BodyPosture(0.0, right, left, (0.0, 0.0), (0.0,) * 4, (0.0,) * 4)))
    told += [wm.SeenHand(side) for side in Side]
    for count, observation in enumerate(told):
        store.write(observed(store.scene, observation, (1, count), 1.0))
    return store.scene


@pytest.fixture(scope="session")
def surveyed_scene() -> Callable[[model.Scene], Scene]:
    """Makes km's scene of a scene."""
    return surveyed


@pytest.fixture(scope="session")
def beginning() -> Scene:
    """The canonical scene after the survey."""
    return surveyed(model.load())


@pytest.fixture(scope="session")
def env2() -> Scene:
    """The second recorded scene after the survey: a box is beside the jar in the cabinet, another before the bowl."""
    return surveyed(model.load(model.CANONICAL.parent / "env2.toml"))


@pytest.fixture(scope="session")
def doors() -> Callable[[float, float], Scene]:
    """Makes the scene with doors after the survey, the left and the right one open so far [rad]."""

    @cache
    def made(*angles: float) -> Scene:
        whole = model.load(model.CANONICAL.with_stem("doors"))
        open_by = dict(zip(("door_1", "door_2"), angles, strict=True))
        hung = (replace(t, xyz=model.NOWHERE, open=open_by[t.id]) if t.of else t for t in whole.things)
        return surveyed(model.hung(replace(whole, things=tuple(hung))))

    return made


@pytest.fixture(scope="session")
def first(beginning: Scene) -> tuple[Km, hfsm.HierarchicalPlan]:
    """The first plan, and km as it was asked for it."""
    km = Km(beginning)
    plan = km.plan("pour", "jar", "bowl")
    assert isinstance(plan, hfsm.HierarchicalPlan), plan.why
    return km, plan


@pytest.fixture(scope="session")
def jar_carried(first: tuple[Km, hfsm.HierarchicalPlan]) -> Scene:
    """The left hand carries the jar, the bowl is still in the cabinet."""
    return first[0].believed(2)


@pytest.fixture(scope="session")
def bowl_out(first: tuple[Km, hfsm.HierarchicalPlan]) -> Scene:
    """Both hands are full."""
    return first[0].believed(3)


@pytest.fixture(scope="session")
def bowl_placed(first: tuple[Km, hfsm.HierarchicalPlan]) -> Scene:
    """The bowl was put down and looked at, the right arm is home: the first plan has ended."""
    return first[0].believed(-1)


@pytest.fixture(scope="session")
def second(bowl_placed: Scene) -> tuple[Km, hfsm.HierarchicalPlan]:
    """The second plan, and km as it was asked for it."""
    km = Km(bowl_placed)
    plan = km.plan("pour", "jar", "bowl", request="p2")
    assert isinstance(plan, hfsm.HierarchicalPlan), plan.why
    return km, plan


@pytest.fixture(scope="session")
def km() -> type[Km]:
    """Makes a km: of a scene, and of what it is starved of."""
    return Km


@pytest.fixture(scope="session")
def named() -> Callable[[hfsm.HierarchicalPlan | hfsm.NoPlan], list[str]]:
    """Names of the states of a plan; a failure with its reason where there is none."""
    return steps
