"""Wrist measurements: the same mass in every posture and motion, a loss at once, and nothing
else.
"""

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from velma.control import grip
from velma.control.cartesian import GRAVITY
from velma.control.grip import Grip, Watch, Wrists, watched
from velma.model.scene import Scene
from velma.names import FT_BODY
from velma.sim.backend import PERIOD_S
from velma.sim.mujoco_backend import compiled

LOW, HIGH = np.array([0.3, 0.2]), np.array([0.42, 0.32])
REST = 0.6  # s at rest before anything happens
KINDS = st.floats(-1.0, 1.0)


class Swung:
    """Two hands swung alike, that hold `masses(t)` (2,) kg, pushed by `push(t)` (3,) N; `error`
    (3,) N of sensors.
    """

    def __init__(
        self, masses, way=(0.0, 0.0, 0.0), turn=(0.0, 0.0, 0.0), error=(0.0, 0.0, 0.0), push=None
    ):
        self.masses, self.way, self.turn = masses, np.array(way), np.array(turn)
        self.error, self.push = np.array(error), push or (lambda t: np.zeros(3))
        self.wrists = Wrists(PERIOD_S)

    def _swing(self, t):
        """Position along the way and its second derivative: at rest first, then 1.5 rad/s."""
        t = max(t - REST, 0.0)
        return 1 - np.cos(1.5 * t), 2.25 * np.cos(1.5 * t) * (t > 0.0)

    def reading(self, t):
        """Rotation, grip position, force in sensor axes of each hand, at that time."""
        s, acceleration = self._swing(t)
        rotation = pin.exp3(s * self.turn)
        lever = grip.POINT_M * rotation[:, 2]
        # The mass centre is at the point c; the grip is beside it.
        centre, up = s * self.way, np.array((0.0, 0.0, GRAVITY))
        pull = acceleration * self.way + up
        force = [(grip.HAND_KG + m) * pull - self.push(t) for m in self.masses(t)]
        axes = rotation.T @ np.array(force).T + self.error[:, None]
        left = np.diag((-1.0, -1.0, 1.0))
        return rotation, centre - lever, np.array([axes[:, 0], left @ axes[:, 1]])

    def run(self, seconds):
        """Yield time, masses and residuals (2,) of each cycle."""
        for k in range(round(seconds / PERIOD_S)):
            rotation, position, _ = self.reading(k * PERIOD_S)
            before = self.reading((k - 1) * PERIOD_S)[2]
            wrist = np.hstack((before, np.zeros((2, 3))))
            felt = self.wrists.feel(wrist, np.array([rotation] * 2), np.array([position] * 2))
            force, gravity = felt[:, 0], felt[:, 1]
            rows = list(zip((force - self.tared).tolist(), gravity.tolist(), strict=True))
            masses = np.array([grip.mass(*row) for row in rows])
            rest = [grip.residual(*rows[k], masses[k], LOW[k], HIGH[k]) for k in (0, 1)]
            if k * PERIOD_S < REST and self.wrists.settled:
                self.last = force, gravity
            yield k * PERIOD_S, masses, np.array(rest)

    tared = np.zeros((2, 3))


def watch(hands, seconds, row):
    """Return the times at which the grip of one hand changed, by grip."""
    known, changes = Watch(), {}
    for t, masses, rest in hands.run(seconds):
        if hands.wrists.settled:
            after = watched(known, float(rest[row]), float(masses[row]), float(LOW[row]))
            if after.grip is not known.grip:
                changes.setdefault(after.grip, t)
            known = after
    return known.grip, changes


def felt_in(hands, seconds):
    """Masses and residuals, (n, 2) each, once the filters have settled."""
    rows = [(m, rest) for _, m, rest in hands.run(seconds) if hands.wrists.settled]
    return (np.array(column) for column in zip(*rows, strict=True))


def constant(right, left):
    return lambda t: (right, left)


def test_the_hand_weighs_what_its_model_does():
    """Every body behind the sensor."""
    model = compiled(Scene("empty"))
    for name in FT_BODY.values():
        assert model.body_subtreemass[model.body(name).id] == pytest.approx(grip.HAND_KG, abs=1e-3)


@settings(max_examples=15, deadline=None)
@given(way=st.tuples(KINDS, KINDS, KINDS), turn=st.tuples(KINDS, KINDS, KINDS))
def test_a_held_mass_is_the_same_however_it_is_swung(way, turn):
    """Acceleration and turning of the hand do not count as a change of the load, in any
    direction.
    """
    hands = Swung(constant(0.35, 0.25), way=np.array(way) * 0.3, turn=turn)
    masses, rest = felt_in(hands, 3.0)
    assert np.abs(masses - (0.35, 0.25)).max() < 0.012
    assert rest.max() < grip.ARM_N


@settings(max_examples=15, deadline=None)
@given(error=st.tuples(KINDS, KINDS, KINDS), turn=st.tuples(KINDS, KINDS, KINDS))
def test_a_tared_hand_knows_no_constant_error(error, turn):
    """Tared in one posture, it feels the true mass in every other one."""
    empty = Swung(constant(0.0, 0.0), error=error)
    for _ in empty.run(REST):
        pass
    hands = Swung(constant(0.35, 0.25), turn=turn, error=error)
    hands.tared = grip.tare(*empty.last)
    masses, rest = felt_in(hands, 2.0)
    assert np.abs(masses - (0.35, 0.25)).max() < 0.02
    assert rest.max() < 0.35


def test_content_may_leave():
    """A jar is held with its content and without."""
    end, changes = watch(Swung(lambda t: (0.36, 0.26 if t < 1.0 else 0.20)), 2.0, row=1)
    assert end is Grip.HELD
    assert set(changes) == {Grip.HELD}
    assert changes[Grip.HELD] < 1.0


@pytest.mark.parametrize(
    ("row", "way"), [(0, (0, 0, 0)), (1, (0, 0, 0)), (0, (0.1, 0.2, 0.1)), (1, (0.2, 0.1, 0.1))]
)
def test_a_loss_is_felt_at_once(row, way):
    """Warned within 60 ms, lost within 0.2 s, at rest and in motion; the other hand is not
    alarmed.
    """

    def masses(t):
        held = [0.3, 0.26]
        held[row] = held[row] if t < 1.5 else 0.0
        return held

    end, changes = watch(Swung(masses, way=way), 2.5, row)
    assert end is Grip.LOST
    assert 1.5 < changes[Grip.WARNED] < 1.56
    assert changes[Grip.LOST] < 1.7
    assert watch(Swung(masses, way=way), 2.5, 1 - row)[0] is Grip.HELD


def test_a_slip_that_is_caught_is_told():
    """The load is gone for a tenth of a second."""
    end, changes = watch(Swung(lambda t: (0.3, 0.0 if 1.0 < t < 1.1 else 0.26)), 2.0, row=1)
    assert end is Grip.SLIPPED
    assert Grip.LOST not in changes


@pytest.mark.parametrize("direction", [(1, 0, 0), (0, 1, 0), (0, 0, -1)])
def test_a_push_is_no_loss(direction):
    """3 N for 0.2 s, sideways or downwards: it is told, and what is held is not given up."""
    hands = Swung(constant(0.3, 0.26), push=lambda t: 3.0 * np.array(direction) * (1.0 < t < 1.2))
    end, changes = watch(hands, 2.0, row=1)
    assert end is Grip.SLIPPED
    assert Grip.WARNED in changes


def test_what_is_not_lifted_is_not_held():
    """A hand that has closed on nothing, or on what its shelf still carries, never becomes sure."""
    assert watch(Swung(constant(0.0, 0.1)), 2.0, row=0) == (Grip.UNSURE, {})
    assert watch(Swung(constant(0.0, 0.1)), 2.0, row=1) == (Grip.UNSURE, {})


@settings(max_examples=200, deadline=None)
@given(st.lists(st.tuples(st.floats(0.0, 5.0), st.floats(-0.1, 0.5)), max_size=400))
def test_nothing_is_lost_without_a_warning_before(readings):
    """And what was lost, or slipped, stays so."""
    known = Watch()
    for r, m in readings:
        after = watched(known, r, m, 0.2)
        if after.grip is not known.grip:
            ends = (Grip.LOST, Grip.SLIPPED)
            after_one = {Grip.UNSURE: (Grip.HELD,), Grip.HELD: (Grip.WARNED,), Grip.WARNED: ends}
            assert after.grip in after_one.get(known.grip, ())
        known = after


def test_a_reading_that_is_not_a_number_changes_nothing():
    """A broken sensor is not a loss."""
    for before in Grip:
        known = Watch(before)
        for _ in range(1000):
            known = watched(known, float("nan"), float("nan"), 0.2)
        assert known.grip is before


def test_what_another_period_kept_is_taken_without_its_constants():
    """The filters go on from there, as fast as their own period asks."""
    other, ours, fresh = Wrists(0.001), Wrists(PERIOD_S), Wrists(PERIOD_S)
    other.feel(np.ones((2, 6)), np.array([np.eye(3)] * 2), np.zeros((2, 3)))
    ours.take(other.record.values.tobytes())
    for name, part in ours.record.part.items():
        of = fresh if name in ("sign", "up", "rate", "gain", "point") else other
        np.testing.assert_array_equal(part, of.record.part[name], err_msg=name)
    assert ours.record.part["gain"] != other.record.part["gain"]
