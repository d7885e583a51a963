"""Evidence of an act that was done: for each row of rc.CHECKS, which senses told in it that the claim is true."""

from collections.abc import Callable, Iterator

import numpy as np

from companion.languages import rc
from companion.languages.evidence import Claim, Evidence, Sense
from services.executor.skills.situation import Situation
from services.executor.skills.skill import Sensed
from velma.control.grip import Grip

IN_HAND_M = 0.25
"""Between grip and origin of a held thing: a jar or bowl is held within 0.15 m of it (grasps.json), estimate."""
_OF_PLACES = (Claim.STANDS, Claim.OPEN)
_IN_HAND = (Grip.HELD, Grip.WARNED, Grip.SLIPPED)
Tells = Callable[[Situation, rc.Act, Sensed, str], bool]


def evidence(here: Situation, command: rc.Act, sensed: Sensed | None) -> tuple[Evidence, ...]:
    """Return the evidence for an act that is done; `sensed`: after its last motion, None if it had none.

    A claim about a held thing is left out where the hand holds nothing.
    """
    return tuple(_rows(here, command, sensed)) if sensed is not None else ()


def _rows(here: Situation, command: rc.Act, sensed: Sensed) -> Iterator[Evidence]:
    for check in rc.CHECKS[type(command)]:
        held = here.held.get(getattr(command, "side", "")) if check.claim is Claim.HELD else None
        if check.claim is Claim.HELD and held is None:
            continue
        of = getattr(command, check.of) if check.of else held.object if held is not None else ""
        by = tuple(sense for sense in check.by if _TELLS[check.claim, sense](here, command, sensed, of))
        uncertainty = here.uncertain.get(of) if Sense.EYES in by and check.claim in _OF_PLACES else None
        within = 0.0 if uncertainty is None else uncertainty.deviation
        yield Evidence(check.claim, of, by, here.time if by else 0.0, within)


def _always(here: Situation, command: rc.Act, sensed: Sensed, of: str) -> bool:
    """The loop ends a motion only where joints, hand and fingers are at its end."""
    return True


def _felt(here: Situation, command: rc.Act, sensed: Sensed, of: str) -> bool:
    side = here.holder(of)
    return side is not None and side in sensed.grips and sensed.grips[side].felt in _IN_HAND


def _touched(here: Situation, command: rc.Act, sensed: Sensed, of: str) -> bool:
    side = here.holder(of)
    return side is not None and any(sensed.touched.get(side, ()))


def _in_hand(here: Situation, command: rc.Act, sensed: Sensed, of: str) -> bool:
    side = here.holder(of)
    inside = here.held[side].T_grip_object.translation if side is not None else np.full(3, np.inf)
    return of in here.looked_at and bool(np.linalg.norm(inside) < IN_HAND_M)


def _seen(here: Situation, command: rc.Act, sensed: Sensed, of: str) -> bool:
    return of in here.looked_at and here.holder(of) is None


def _looked(here: Situation, command: rc.Act, sensed: Sensed, of: str) -> bool:
    return bool(here.looked_at)


def _weighed(here: Situation, command: rc.Act, sensed: Sensed, of: str) -> bool:
    return here.weighed is not None and here.weighed[0] - here.weighed[1] >= rc.LEAST_WEIGHED_KG


def _arrived(here: Situation, command: rc.Act, sensed: Sensed, of: str) -> bool:
    return here.arrived is True


_TELLS: dict[tuple[Claim, Sense], Tells] = {
    (Claim.THERE, Sense.JOINTS): _always,
    (Claim.HELD, Sense.WRIST): _felt,
    (Claim.HELD, Sense.FINGERS): _touched,
    (Claim.HELD, Sense.EYES): _in_hand,
    (Claim.STANDS, Sense.EYES): _seen,
    (Claim.OPEN, Sense.EYES): _seen,
    (Claim.LOOKED, Sense.EYES): _looked,
    (Claim.LEFT, Sense.WRIST): _weighed,
    (Claim.LEFT, Sense.EYES): _arrived,
    (Claim.ARRIVED, Sense.EYES): _arrived,
}
