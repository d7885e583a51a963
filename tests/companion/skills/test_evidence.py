"""Evidence of acts in the true loop: a hand is felt, touched and seen to hold its thing, each by
its own sense.
"""

import dataclasses

import pytest
from msgspec.structs import replace

from companion.acts import ACTS
from companion.languages import rc
from companion.languages.evidence import Claim, Sense
from companion.languages.values import Side
from companion.skills import motions
from companion.skills.performing import SKILLS
from companion.skills.senses import TELLS
from companion.skills.senses import evidence as evidence_of
from services.executor.simulation import InProcess
from velma.control.grip import Grip

JAR, LEFT = "jar_1", Side.LEFT
pytestmark = pytest.mark.timeout(240)  # the first test of the folder also takes the jar


def evidence(here, command, sensed):
    """The evidence for an act that is done."""
    return evidence_of(here, command, sensed, SKILLS[type(command)].tells)


def test_each_sense_of_the_table_can_tell():
    """What ex judges is what the language says, no more and no less; a task adds only what its own
    acts claim.
    """
    told = set()
    for act, row in SKILLS.items():
        claims = {(check.claim, sense) for check in ACTS[act].checks for sense in check.by}
        assert set(row.tells) <= claims <= {*TELLS, *row.tells}
        told |= claims
    assert set(TELLS) <= told
    assert set(SKILLS) == set(ACTS)


def sensed_by(acting):
    """Return what the robot senses where it stands, its head on the jar."""
    body = InProcess(acting.core, acting.eye)
    at = acting.here.robot.grip(acting.here.q, LEFT).translation
    return body.do(motions.still(acting.here, "look", watch=at, settle_s=0.3))


def told(acting, sensed):
    """Return which senses tell that the left hand holds the jar."""
    acting.here.begin()
    acting.here.see(sensed.sights)
    move = rc.MoveJoint("act", LEFT, (), 0.1)
    (held,) = [one for one in evidence(acting.here, move, sensed) if one.claim is Claim.HELD]
    assert held.of == JAR
    assert held.at == (acting.here.time if held.by else 0.0)
    return set(held.by)


def test_each_sense_is_missed_alone(jar_out):
    """Without one of them the others still tell; without any the claim is there, and not
    checked.
    """
    sensed = sensed_by(jar_out)
    blind = dataclasses.replace(sensed, sights=[])
    deaf = dataclasses.replace(blind, grips={})
    numb = dataclasses.replace(deaf, touched={})
    assert told(jar_out, sensed) == {Sense.WRIST, Sense.FINGERS, Sense.EYES}
    assert told(jar_out, blind) == {Sense.WRIST, Sense.FINGERS}
    assert told(jar_out, deaf) == {Sense.FINGERS}
    assert told(jar_out, numb) == set()
    unsure = {"left": replace(sensed.grips["left"], felt=Grip.UNSURE)}
    assert told(jar_out, dataclasses.replace(numb, grips=unsure)) == set()


def test_an_empty_hand_claims_nothing(jar_out):
    """A motion of the other hand says only that the arm is there."""
    sensed = sensed_by(jar_out)
    move = rc.MoveJoint("act", Side.RIGHT, (), 0.1)
    assert [one.claim for one in evidence(jar_out.here, move, sensed)] == [Claim.THERE]
