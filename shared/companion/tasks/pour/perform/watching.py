"""Eyes on the thing that something is poured into, while it is poured.

The jar is turned back if that thing was moved, fell over, is gone, or if another thing is above it. One look proves
nothing: a picture may be too dark, a sight may be wrong. In doubt the next look is soon; only a sight of the thing in
its place ends a doubt. A thing that is not seen is gone only where it would surely be seen; jar, hand and stream may
hide it.
"""

from collections.abc import Generator

import numpy as np

from companion.languages.facts import Facts, Kind, fact
from companion.skills.loop_messages import Cancel, LookAgain, Motion, Phase
from companion.skills.sight import Sight
from companion.skills.situation import FALLEN, SURE_MARKERS, Situation
from companion.skills.skill import Asked, Sensed
from companion.tasks.pour.done import PourKind
from velma.kinematics.frames import tilt

LOOK_EVERY_S = 0.25
"""Between two looks [s, simulated]; estimate: a tilt takes 2.2 s, a look 80 ms of processor time."""
DOUBT_S = 0.1  # to the next look in doubt; estimate: as long as a look takes
SEEN_WRONG, UNSEEN, MARKERS = 2, 2, 9
"""Looks in a row that show it in a wrong place, or that do not show it, with so many markers in view in all of them,
before something is wrong. A picture that shows nothing at all counts half. Estimates: 2 % of the sights of noisy eyes
are outliers; of pictures up to 40 % too dark or bright, some show no marker; nine are those of three sure looks."""
TWO = 2  # markers in view that tell as much as three, where the last look showed the thing by no more (estimate)
FLOWS = np.radians(75.0)  # tilt of the jar up to which nothing covers markers inside the bowl (estimate)


class Watch:
    """What is known of the destination of a pour during one tilt. `why`: what is wrong with it, () for nothing.

    `gone`: it was not seen, and nothing hid it.
    """

    def __init__(self, here: Situation, name: str, side: str, rim_radius: float) -> None:
        self._here, self._name, self._side, self._rim_radius = here, name, side, rim_radius
        self._at = here.seen[name]
        self._before = here.above(name)
        self._seen_by: frozenset[int] = frozenset()  # markers that were in view when it was seen last
        self._wrong, self._unseen, self._markers = 0, 0, 0.0
        self.why: Facts = ()
        self.gone = False

    def during(self, motion: Motion) -> Generator[Asked, Sensed, Sensed]:
        """Run a motion, brake it if something is wrong, and return what is sensed at its end."""
        sensed = yield motion
        while sensed.ended == Phase.RUNNING:
            self._judge(sensed)
            doubt = self._wrong + self._unseen > 0
            if self.why:
                sensed = yield Cancel(motion.key)
            else:
                sensed = yield LookAgain(motion.key, DOUBT_S if doubt else LOOK_EVERY_S)
        return sensed

    def _judge(self, sensed: Sensed) -> None:
        here = self._here
        here.stand(sensed.measured, sensed.head, sensed.fingers, sensed.time)
        if sensed.wrong or sensed.off:  # a camera or joints that are not well tell nothing of the thing
            return
        if tilt(here.robot.grip(here.q, self._side) * here.held[self._side].T_grip_object) > FLOWS:
            here.filled.add(self._name)
        for sight in sensed.sights:
            if sight.name != self._name and here.holder(sight.name) is None:
                here.place(sight.name, sight.T_world_object)
        wrong = self._above() or next((self._aside(one) for one in sensed.sights if one.name == self._name), ())
        if wrong:
            self._wrong += 1
        seen = any(one.name == self._name for one in sensed.sights)
        if seen and not wrong:
            self._wrong = 0
        if seen:
            self._seen_by, self._unseen, self._markers = here.in_view(self._name, self._at), 0, 0.0
        elif sure := self._sure():
            self._unseen, self._markers = self._unseen + 1, self._markers + sure * (1.0 if sensed.sights else 0.5)
        if self._wrong >= SEEN_WRONG:
            self.why = (fact(PourKind.DURING_THE_TILT, wrong),)
        elif self._unseen >= UNSEEN and self._markers >= MARKERS:
            self.why, self.gone = (fact(PourKind.DURING_THE_TILT, fact(Kind.OUT_OF_VIEW, self._name)),), True

    def _above(self) -> Facts:
        """Return what is above it that was not there before, () for nothing."""
        above = sorted(self._here.above(self._name, self._at) - self._before)
        return (fact(Kind.ABOVE, above[0], self._name),) if above else ()

    def _aside(self, sight: Sight) -> Facts:
        """Return in what way it is seen elsewhere than before, () where it is not."""
        seen = sight.T_world_object
        if seen.rotation[:, 2] @ self._at.rotation[:, 2] < FALLEN:
            return (fact(Kind.FELL_OVER, self._name),)
        moved = float(np.linalg.norm(seen.translation - self._at.translation))
        return (fact(Kind.MOVED, self._name, moved),) if moved > self._rim_radius / 2.0 else ()

    def _sure(self) -> int:
        """Return by how many markers it would surely be seen from here; 0: it need not be seen.

        By three, or by two where the last look that showed it had no more in view.
        """
        now = self._here.in_view(self._name, self._at)
        sure = len(now) >= SURE_MARKERS or (len(now) >= TWO and now >= self._seen_by > frozenset())
        return len(now) if sure else 0
