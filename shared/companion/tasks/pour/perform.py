"""The skill that pours: the tilt is solved again for the poses of jar and bowl as they are seen
now.

While it is tilted, the eyes look at the destination, and the jar goes back if that is not there any
more (class Watch). The jar is weighed in the same posture before and after: what left it was felt.
With much still in it, it is tilted once more, farther. A pour that goes on after an interruption
adds what left in the earlier tilts; what is taken out of the jar between two tilts was not poured.
What left may have fallen beside: at last the hand is drawn back, and the destination is looked
into. Only what is seen in it has arrived.
"""

import math
from collections.abc import Generator
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np
from msgspec import structs

from companion import models
from companion.languages.evidence import AnyClaim, Sense
from companion.languages.facts import Facts, Kind, fact
from companion.skills import motions, moving
from companion.skills.loop_messages import Cancel, GripReport, LookAgain, Motion, Phase
from companion.skills.motions import AHEAD
from companion.skills.moving import joining, straight
from companion.skills.senses import missed, require
from companion.skills.situation import FALLEN, SURE_MARKERS, Sight, Situation, Unfinished
from companion.skills.skill import (
    Asked,
    Cancelled,
    NotPossible,
    Sensed,
    Skill,
    SkillRow,
    Tells,
    despite_cancel,
    empty,
    failed,
    missing,
    replan,
)
from companion.tasks.pour.done import LEAST_WEIGHED_KG, Pour, PourClaim, PourKind
from velma import names
from velma.control.grip import Grip
from velma.kinematics import ik
from velma.kinematics.frames import shifted, tilt
from velma.kinematics.tasks import BACK_SPEED, LOADED_SPEED, TILT_SPEED
from velma.kinematics.tasks.looking import REST_S
from velma.kinematics.tasks.pouring import Stream, follow, stream

LOOK_EVERY_S = 0.25
"""Between two looks [s, simulated]; estimate: a tilt takes 2.2 s, a look 80 ms of processor
time.
"""
DOUBT_S = 0.1  # to the next look in doubt; estimate: as long as a look takes
SEEN_WRONG, UNSEEN, MARKERS = 2, 2, 9
"""Looks in a row after which something is wrong: SEEN_WRONG that show the destination in a wrong
place, or UNSEEN that do not show it while at least MARKERS of its markers, summed over these looks,
should have been in view. A picture that shows nothing counts half.
Estimates: 2 % of the sights of noisy eyes are outliers; of pictures up to 40 % too dark or bright,
some show no marker; nine are those of three sure looks.
"""
# enough in place of SURE_MARKERS, where the last look that showed the thing had no more markers in
# view (estimate)
FEWER_MARKERS = 2
# from this tilt of the jar on, content may cover markers inside the bowl (estimate)
INSIDE_HIDDEN_TILT = np.radians(75.0)


class Watch:
    """What is known of the destination of a pour during one tilt. `why`: what is wrong with it, ()
    for nothing.

    `gone`: it was not seen, and nothing hid it.
    """

    def __init__(self, here: Situation, name: str, side: str, rim_radius: float) -> None:
        self._here, self._name, self._side, self._rim_radius = here, name, side, rim_radius
        self._at = here.seen[name]
        self._before = here.above(name)
        # markers that were in view when it was seen last
        self._seen_by: frozenset[int] = frozenset()
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
        # a camera or joints that are not well tell nothing of the thing
        if sensed.wrong or sensed.off:
            return
        if (
            tilt(here.robot.grip(here.q, self._side) * here.held[self._side].T_grip_object)
            > INSIDE_HIDDEN_TILT
        ):
            here.filled.add(self._name)
        for sight in sensed.sights:
            if sight.name != self._name and here.holder(sight.name) is None:
                here.place(sight.name, sight.T_world_object)
        sights = (one for one in sensed.sights if one.name == self._name)
        wrong = self._above() or next((self._aside(one) for one in sights), ())
        if wrong:
            self._wrong += 1
        seen = any(one.name == self._name for one in sensed.sights)
        if seen and not wrong:
            self._wrong = 0
        if seen:
            self._seen_by, self._unseen, self._markers = here.in_view(self._name, self._at), 0, 0.0
        elif sure := self._sure():
            self._unseen += 1
            self._markers += sure * (1.0 if sensed.sights else 0.5)
        if self._wrong >= SEEN_WRONG:
            self.why = (fact(PourKind.DURING_THE_TILT, wrong),)
        elif self._unseen >= UNSEEN and self._markers >= MARKERS:
            self.why = (fact(PourKind.DURING_THE_TILT, fact(Kind.OUT_OF_VIEW, self._name)),)
            self.gone = True

    def _above(self) -> Facts:
        """What is above it that was not there before, () for nothing."""
        above = sorted(self._here.above(self._name, self._at) - self._before)
        return (fact(Kind.ABOVE, above[0], self._name),) if above else ()

    def _aside(self, sight: Sight) -> Facts:
        """In what way it is seen elsewhere than before, () where it is not."""
        seen = sight.T_world_object
        if seen.rotation[:, 2] @ self._at.rotation[:, 2] < FALLEN:
            return (fact(Kind.FELL_OVER, self._name),)
        moved = float(np.linalg.norm(seen.translation - self._at.translation))
        return (fact(Kind.MOVED, self._name, moved),) if moved > self._rim_radius / 2.0 else ()

    def _sure(self) -> int:
        """The number of markers by which it would surely be seen from here; 0: it need not be seen.

        By three, or by two where the last look that showed it had no more in view.
        """
        now = self._here.in_view(self._name, self._at)
        sure = len(now) >= SURE_MARKERS or (
            len(now) >= FEWER_MARKERS and now >= self._seen_by > frozenset()
        )
        return len(now) if sure else 0


# --- the skill -----------------------------------------------------------------------------------


WEIGH_S = 1.0  # [s] at rest, until the weight is true to 1 g (velma.control.grip.LOAD_S)
MUCH = 0.25  # of the content, left after a tilt; estimate: of 60 g as much as LEAST_WEIGHED_KG
# of the second tilt; estimate: grains that stick to a wall of 45 degrees slide at 60
FARTHER = math.radians(15.0)
ENOUGH = 0.55
"""Share of what left the source that is to be seen in the destination: with less, more is missing
than a look errs by. 27 of 30 grains that stick to each other were seen as 18 (the worst of all
trials), 13 as 9.
"""
PARTLY = 0.08
"""Share of what left the source that is to be seen in a destination that stands where it was, where
some of it is hidden. Of 30 grains in a bowl, 7 to 12 were seen from 40 degrees (8 pours), 3 to 23
from 37 (velma.eyes.content). In an empty bowl no grain is ever seen.
"""
# more in the destination than before; a look errs by up to 5 grains of 2 g (velma.eyes.content)
LEAST_SEEN_KG = 0.015
# of the destination, seen only above it: a stream that misses by more falls beside (estimate)
MOVED_M = 0.015
SEEN_KG = 0.06  # content of which all is seen: of more, a pile hides some (velma.eyes.content)
AWAY = ((0.15, 0.0), (0.25, 0.0), (0.25, 0.1), (0.15, 0.2), (0.3, 0.2), (0.0, 0.3))
"""Ways of the hand after a pour [m]: back, against the direction of the stream, and up;
estimates.
"""
AROUND = tuple((k * math.tau / 8.0, back) for k in range(1, 8) for back in (0.1, 0.2, 0.3))
"""Ways where none of those leaves the opening in view: the angle [rad] from that direction, and how
far [m]; estimates. After a stop the arm may stand elsewhere: its elbow was before the bowl, and so
near the head that it could not turn.
"""


@dataclass
class Poured:
    """What a pour has found out: the mass in the hand before and after it [kg], whether what left
    is seen in the destination. None: it was not felt, or not looked into.
    """

    weighed: tuple[float, float] | None = None
    arrived: bool | None = None

    @property
    def left(self) -> bool:
        """Whether the hand felt content leave."""
        return self.weighed is not None and self.weighed[0] - self.weighed[1] >= LEAST_WEIGHED_KG


def pour(here: Situation, command: Pour) -> Skill:
    """Pour. Raises replan if the source is not held, the destination not seen, or the tilt
    impossible; missing if the destination is not there any more, empty if the hand does not feel
    the source, failed if nothing left it, or if no sense can check it.
    """
    held = here.held.get(command.side)
    if held is None or held.object != command.source:
        raise replan(fact(Kind.HOLDS_NOT, command.side, command.source))
    if command.destination not in here.seen:
        raise replan(fact(Kind.NOT_SEEN, command.destination))
    flow = _stream(here, command)
    first = (
        flow.source(command.tilts[0], command.azimuth, command.spin) * held.T_grip_object.inverse()
    )
    q = ik.solve(here.robot, command.side, first, here.q, columns=names.ARM[command.side])
    tilt = None if q is None else _tilt(here, command, flow, q)
    if q is None or tilt is None:
        raise replan(fact(PourKind.NO_TILT, command.source, command.destination))
    rim = flow.rim
    before = yield motions.along(
        here, command.key, joining(here, q), TILT_SPEED, watch=rim, settle_s=WEIGH_S
    )
    if _grip(command, before).felt == Grip.UNSURE and _grip(command, before).mass < held.mass / 2.0:
        raise empty(fact(Kind.FEELS_NOT, command.side, command.source))
    if (yield from missed(here, command.key, command.destination, before)):
        raise missing(fact(Kind.NOT_WHERE_IT_WAS, command.destination))
    require(here, command.side)
    moved = float(np.linalg.norm(_stream(here, command).rim - rim))
    if moved > MOVED_M:
        raise replan(fact(PourKind.BEFORE_THE_TILT, fact(Kind.MOVED, command.destination, moved)))
    _begin(here, command, before)
    after = yield from _tilted(here, command, flow, tilt)
    if _much_left(here, command, after):
        after = yield from _tilted(here, command, flow, _farther(here, command, flow, tilt))
    here.noted = poured = Poured()
    begun, left = here.unfinished.pop(command.source), _felt(command, after)
    if begun.full is not None and left is not None:  # the hand felt it before and after
        poured.weighed = begun.full, left
    here.looked_into.discard(command.destination)  # what was seen in it before this is old
    here.at_least.pop(command.destination, None)
    with suppress(NotPossible, Cancelled):  # the pour is over: what hinders only ends the look
        sensed = yield from _drawn_back(here, command, rim, BACK_SPEED)
        yield from missed(here, command.key, command.destination, sensed)
    _judge(here, command, begun, rim, poured)


def _drawn_back(
    here: Situation, command: Pour, rim: np.ndarray, speed: float
) -> Generator[Asked, Sensed, Sensed]:
    """Draw the hand back, at this speed [m/s], until the opening is in view; return what is sensed
    then.
    """
    back = motions.along(here, command.key, _away(here, command, rim), speed, watch=rim)
    sensed = yield back
    if back.head == AHEAD:  # an arm was near it on the way
        sensed = yield motions.still(here, command.key, watch=rim, settle_s=REST_S)
    return sensed


def _away(here: Situation, command: Pour, rim: np.ndarray) -> list[np.ndarray]:
    """The first straight way of the hand, none at best, that hides the least of the destination."""
    grip = here.robot.grip(here.q, command.side)
    ways = [
        *((0.0, back, up) for back, up in AWAY),
        *((around, back, 0.0) for around, back in AROUND),
    ]
    best: list[np.ndarray] = []
    least = _hidden(here, command, rim, here.q)
    for around, back, up in ways:
        if least == 0:
            break
        azimuth = command.azimuth + around
        way = [-back * math.cos(azimuth), -back * math.sin(azimuth), up]
        with suppress(NotPossible):
            path = straight(here, command.side, here.q, shifted(grip, way), here.world.free)
            if (hidden := _hidden(here, command, rim, path[-1])) < least:
                best, least = path, hidden
    return best


def _hidden(here: Situation, command: Pour, rim: np.ndarray, q: np.ndarray) -> float:
    """How many points of the destination's opening are hidden at q (15,), with the head turned to
    it.

    Infinite where an arm is too near the head.
    """
    head = motions.turned(here, q, rim)
    return math.inf if head is None else here.hidden(command.destination, q, (head.pan, head.tilt))


def _judge(
    here: Situation, command: Pour, begun: Unfinished, rim: np.ndarray, poured: Poured
) -> None:
    """Note whether what was in the source is seen in the destination; nothing if that was not
    looked into.

    `rim` (3,): the middle of its opening during the tilt [m, world]. Raises failed if nothing left
    the source, by the weight, and nothing is seen in the destination either: a wrist that feels no
    difference may be wrong.
    """
    name = command.destination
    before, after = poured.weighed or (begun.full or command.empty_mass, command.empty_mass)
    felt = poured.left
    nothing_left = poured.weighed is not None and not felt
    # What is known to have left; where no difference was felt, what was in the source.
    content = before - (command.empty_mass if nothing_left else after)
    if name in here.missing:
        poured.arrived = False
    elif name in here.looked_into:
        seen = here.contents[name]
        more = felt or seen > begun.had + LEAST_SEEN_KG
        poured.arrived = more and seen > ENOUGH * min(begun.had + content, SEEN_KG)
    elif (
        name in here.at_least
        and felt
        and np.linalg.norm(_stream(here, command).rim - rim) < MOVED_M
    ):
        least = max(PARTLY * min(content, SEEN_KG), LEAST_SEEN_KG if begun.had else 0.0)
        poured.arrived = here.at_least[name] > begun.had + least or None
    if nothing_left and not poured.arrived:
        raise failed(fact(PourKind.NOTHING_LEFT, command.source, before, after))


def _tilted(
    here: Situation, command: Pour, flow: Stream, tilt: list[np.ndarray]
) -> Generator[Asked, Sensed, Sensed]:
    """Tilt, hold, and turn back along the same way; return what is felt then.

    Raises missing or replan if the destination is not as it was when the tilt began.
    """
    rim, watch = flow.rim, Watch(here, command.destination, command.side, flow.rim_radius)
    tilting = motions.along(
        here,
        command.key,
        tilt[1:],
        TILT_SPEED,
        watch=rim,
        settle_s=command.hold,
        look_every_s=LOOK_EVERY_S,
    )
    try:
        yield from watch.during(tilting)
    except (Cancelled, NotPossible):
        if not watch.why:
            _interrupt(here, command, (yield _upright(here, command, tilt, rim)))
            raise
    finally:
        here.filled.add(command.destination)
    if watch.why:
        after = yield from despite_cancel(lambda: _upright(here, command, tilt, rim))
        _interrupt(here, command, after)
        if watch.gone and not (yield from _found(here, command, rim, after)):
            here.give_up(command.destination)
            raise missing(fact(Kind.NOT_WHERE_IT_WAS, command.destination, watch.why))
        raise replan(*watch.why)
    rest = motions.payload(command.side, command.empty_mass, here.held[command.side].T_grip_object)
    # A cancel from here on changes nothing: the jar goes upright either way.
    return (
        yield motions.along(
            here, command.key, tilt[::-1][1:], BACK_SPEED, watch=rim, settle_s=WEIGH_S, **rest
        )
    )


def _upright(here: Situation, command: Pour, tilt: list[np.ndarray], rim: np.ndarray) -> Motion:
    """The way back from somewhere in a tilt."""
    return motions.along(
        here, command.key, moving.back(here, tilt), BACK_SPEED, watch=rim, settle_s=WEIGH_S
    )


def _found(
    here: Situation, command: Pour, rim: np.ndarray, after: Sensed
) -> Generator[Asked, Sensed, bool]:
    """Whether the destination is seen after a tilt in which it was not: also with the hand drawn
    back.

    Jar and hand, upright again, may hide what they left in view before. `after`: sensed upright.
    """
    name = command.destination
    if _shown(name, after):
        return True
    again = yield motions.still(
        here, command.key, watch=here.seen[name].translation, settle_s=REST_S
    )
    if not _shown(name, again) and not here.surely_seen(name):
        with suppress(NotPossible):
            again = yield from _drawn_back(here, command, rim, LOADED_SPEED)
    return _shown(name, again)


def _shown(name: str, sensed: Sensed) -> bool:
    return name in {sight.name for sight in sensed.sights}


def _much_left(here: Situation, command: Pour, after: Sensed) -> bool:
    """Whether the hand feels that much of the content is still in the source; never without
    sensors.
    """
    begun, mass = here.unfinished.get(command.source), _felt(command, after)
    if begun is None or begun.full is None or mass is None:
        return False
    rest, content = mass - command.empty_mass, begun.full - command.empty_mass
    return rest > max(LEAST_WEIGHED_KG, MUCH * content)


def _farther(
    here: Situation, command: Pour, flow: Stream, tilt: list[np.ndarray]
) -> list[np.ndarray]:
    """A tilt that begins as this one and goes farther; this one where the arm cannot."""
    first, last = command.tilts
    return (
        _tilt(here, structs.replace(command, tilts=(first, last + FARTHER)), flow, tilt[0]) or tilt
    )


def _grip(command: Pour, sensed: Sensed) -> GripReport:
    return sensed.grips.get(str(command.side), GripReport())


def _begin(here: Situation, command: Pour, before: Sensed) -> None:
    """Note the mass before the tilt, and what left in earlier tilts into the same thing."""
    earlier = here.unfinished.pop(command.source, None)
    full, had = _felt(command, before), here.contents.get(command.destination, 0.0)
    if earlier is not None and earlier.destination == command.destination:
        had = earlier.had
        if full is None or earlier.full is None:
            full = full or earlier.full
        else:
            full = max(full, earlier.full) if earlier.left is None else full + earlier.left
    here.unfinished[command.source] = Unfinished(command.destination, full, had=had)


def _felt(command: Pour, sensed: Sensed) -> float | None:
    """The mass [kg] that is felt in the hand; None without a sensor, or where it does not feel the
    source.
    """
    grip = _grip(command, sensed)
    return grip.mass if grip.felt == Grip.HELD else None


def _interrupt(here: Situation, command: Pour, after: Sensed) -> None:
    """Note what has left the source when a pour is interrupted; nothing if the hand does not feel
    it.
    """
    begun, rest = here.unfinished.get(command.source), _felt(command, after)
    if begun is not None and begun.full is not None and rest is not None:
        left = max(0.0, begun.full - rest)
        here.unfinished[command.source] = Unfinished(begun.destination, begun.full, left, begun.had)


def _stream(here: Situation, command: Pour) -> Stream:
    rim = models.MODELS[here.models[command.destination]].hole
    opening = models.MODELS[here.models[command.source]].hole
    if rim is None or opening is None:
        closed = command.destination if rim is None else command.source
        raise failed(fact(Kind.NO_OPENING, closed))
    return stream(here.seen[command.destination], rim.centre, rim.radius, opening.centre)


def _tilt(here: Situation, command: Pour, flow: Stream, q: np.ndarray) -> list[np.ndarray] | None:
    T_grip_object = here.held[command.side].T_grip_object
    about = (command.azimuth, command.spin, command.tilts)
    return follow(here.robot, here.world, command.side, q, T_grip_object, flow, *about)


def _arrived(here: Situation, command: Pour, sensed: Sensed, of: str) -> bool:
    return isinstance(here.noted, Poured) and here.noted.arrived is True


def _done(here: Situation) -> dict[str, Any]:
    poured = here.noted if isinstance(here.noted, Poured) else Poured()
    return {"weighed": poured.weighed, "arrived": poured.arrived}


TELLS: dict[tuple[AnyClaim, Sense], Tells] = {
    (PourClaim.LEFT, Sense.WRIST): lambda here, command, sensed, of: (
        isinstance(here.noted, Poured) and here.noted.left
    ),
    (PourClaim.LEFT, Sense.EYES): _arrived,
    (PourClaim.ARRIVED, Sense.EYES): _arrived,
}
SKILLS = (SkillRow(Pour, pour, carries=True, checked=True, tells=TELLS, done=_done),)
