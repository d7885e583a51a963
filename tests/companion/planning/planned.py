"""km as the planner asks it: its memory filled through the receptor, and what plans suppose taken
for observed.
"""

from companion.languages import hfsm, rc, wm
from companion.languages.facts import Kind, fact
from companion.languages.values import BodyPosture, Pose, Side
from companion.planning.search import search
from companion.skills.motions import aim
from companion.world.observe import observed
from services.executor import simulation
from services.knowledge import answers
from services.knowledge.memory import Overlays
from services.knowledge.store import Store
from services.task.outgoing_messages import SURVEY
from velma import names
from velma.kinematics.frames import xyz_quat
from velma.sim.mujoco_backend import MujocoBackend

SEED = 7


class Km:
    """Answers as km does, writes down what was asked, and knows nothing of what `starved` says yes
    to.
    """

    def __init__(self, scene, starved=lambda query: False):
        self.scene, self.overlays, self.starved = scene, Overlays(), starved
        self.asked = []

    def ask(self, query):
        """The answer; Unknown to what km is starved of."""
        self.asked.append(query)
        if self.starved(query):
            return wm.Unknown((fact(Kind.UNKNOWN_TO_KM, type(query).__name__),))
        self.overlays, answer = answers.ask(self.scene, self.overlays, query)
        return answer

    def plan(self, *task, request="p1", seed=SEED):
        """Return the search's result for a task."""
        asked = hfsm.GroundTaskNetwork(request, (hfsm.Task(task[0], task[1:]),))
        return search(asked, self.ask, seed)

    def believed(self, number):
        """The scene once the hypothetical state with this number was observed to be so."""
        supposed = list(self.overlays.states.values())[number].scene
        joints = supposed.joints
        seen = [
            wm.SeenBody(BodyPosture(joints["torso"][0], *(joints[part] for part in PARTS))),
            *(
                wm.SeenHand(side, held.object, held.grasp, held.pose)
                for side, held in supposed.hands.items()
            ),
            *(
                wm.SeenObject(t.id, t.model, t.pose, 2.0)
                for t in supposed.things.values()
                if not supposed.holder(t.id)
            ),
        ]
        return told(self.scene, *seen)


def told(scene, *observations):
    """The scene with these observations, newer than all before."""
    newest, _ = max(scene.versions.values(), default=(0, 0))
    for count, observation in enumerate(observations):
        scene = observed(scene, observation, (newest + 1, count), 3.0)
    return scene


PARTS = ("right_arm", "left_arm", "head", "right_hand", "left_hand")


def steps(plan):
    """Names of the states of a plan."""
    return [state.name for state in plan.root.states]


def acts(plan, kind=rc.Command):
    """The acts of a plan that are of this kind, in their order; a failure with its reason where
    there is none.
    """
    assert isinstance(plan, hfsm.HierarchicalPlan), plan.why
    return [act for act in hfsm.acts(plan.root) if isinstance(act, kind)]


def ends(plan):
    """The end of a plan if all its acts succeed."""
    return getattr(plan.root.states[-1], "outcome", hfsm.Outcome.SUCCEEDED)


def surveyed(scene):
    """Return km's scene when the robot stands in its start posture and has looked around, with the
    receptor's noise.
    """
    backend, eye = MujocoBackend(scene), simulation.receptor(scene)
    models = simulation.model_names(scene)
    qpos, store = backend.configuration().copy(), Store.open()
    told = []
    for point in SURVEY.at:
        goal = aim(0.0, point)
        for name, angle in zip(names.HEAD, (goal.pan, goal.tilt), strict=True):
            qpos[backend.model.joint(name).qposadr[0]] = angle
        seen = eye.look(qpos)
        told += [
            wm.SeenObject(s.name, models[s.name], Pose(*xyz_quat(s.T_world_object)), 1.0)
            for s in seen
        ]
    right, left = (tuple(map(float, names.START[names.ARM[side]])) for side in ("right", "left"))
    told.append(wm.SeenBody(BodyPosture(0.0, right, left, (0.0, 0.0), (0.0,) * 4, (0.0,) * 4)))
    told += [wm.SeenHand(side) for side in Side]
    for count, observation in enumerate(told):
        store.write(observed(store.scene, observation, (1, count), 1.0))
    return store.scene
