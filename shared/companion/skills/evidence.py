"""Evidence of an act that was done: for each of its checks (companion.acts), which senses told that
it is true.
"""

from collections.abc import Mapping

import numpy as np

from companion.acts import ACTS
from companion.languages import rc
from companion.languages.evidence import AnyClaim, Claim, Evidence, Sense
from companion.skills.situation import Situation
from companion.skills.skill import Sensed, Tells
from velma.control.grip import Grip

IN_HAND_M = 0.25
"""Between grip and origin of a held thing: a jar or bowl is held within 0.15 m of it (grasps.json),
estimate.
"""
_IN_HAND = (Grip.HELD, Grip.WARNED, Grip.SLIPPED)
Tellers = Mapping[tuple[AnyClaim, Sense], Tells]


def evidence(
    here: Situation, command: rc.Command, sensed: Sensed | None, own: Tellers
) -> tuple[Evidence, ...]:
    """The evidence for an act that is done; `sensed`: after its last motion, None if it had none.

    `own`: how senses tell the claims of this act alone. A claim about a held thing is left out
    where the hand holds nothing, and one about a thing where the command names none.
    """
    if sensed is None:
        return ()
    tells, found = {**TELLS, **own}, []
    for check in ACTS[type(command)].checks:
        held = here.held.get(getattr(command, "side", "")) if check.claim is Claim.HELD else None
        if check.claim is Claim.HELD and held is None:
            continue
        of = getattr(command, check.of) if check.of else held.object if held is not None else ""
        if check.of and not of:
            continue
        telling = {sense: tells[check.claim, sense] for sense in check.by}
        by = tuple(sense for sense, tell in telling.items() if tell(here, command, sensed, of))
        of_place = Sense.EYES in by and tells[check.claim, Sense.EYES] is seen
        uncertainty = here.uncertain.get(of) if of_place else None
        within = 0.0 if uncertainty is None else uncertainty.deviation
        found.append(Evidence(check.claim, of, by, here.time if by else 0.0, within))
    return tuple(found)


def _felt(here: Situation, command: rc.Command, sensed: Sensed, of: str) -> bool:
    side = here.holder(of)
    return side is not None and side in sensed.grips and sensed.grips[side].felt in _IN_HAND


def _touched(here: Situation, command: rc.Command, sensed: Sensed, of: str) -> bool:
    side = here.holder(of)
    return side is not None and any(sensed.touched.get(side, ()))


def _in_hand(here: Situation, command: rc.Command, sensed: Sensed, of: str) -> bool:
    side = here.holder(of)
    inside = here.held[side].T_grip_object.translation if side is not None else np.full(3, np.inf)
    return of in here.looked_at and bool(np.linalg.norm(inside) < IN_HAND_M)


def seen(here: Situation, command: rc.Command, sensed: Sensed, of: str) -> bool:
    """Tell a claim about the place of a thing: it was seen there, in no hand."""
    return of in here.looked_at and here.holder(of) is None


TELLS: Tellers = {
    # The loop ends a motion only where joints, hand and fingers are at its end.
    (Claim.THERE, Sense.JOINTS): lambda here, command, sensed, of: True,
    (Claim.HELD, Sense.WRIST): _felt,
    (Claim.HELD, Sense.FINGERS): _touched,
    (Claim.HELD, Sense.EYES): _in_hand,
    (Claim.STANDS, Sense.EYES): seen,
    (Claim.LOOKED, Sense.EYES): lambda here, command, sensed, of: bool(here.looked_at),
}
"""How senses tell the claims that acts of any task may have."""
