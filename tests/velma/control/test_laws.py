"""Properties of the control laws as functions: no simulation here."""

import math

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from velma.control import cartesian, joint, safety
from velma.control.cartesian import CartesianGains, CartesianImpedance
from velma.control.dynamics import Dynamics
from velma.model.build import ROBOT_XML
from velma.names import HEAD_LOWER, HEAD_SPEED, HEAD_UPPER, LOWER, TORQUE, UPPER

DYNAMICS = Dynamics(ROBOT_XML)

postures = hnp.arrays(float, 15, elements=st.floats(0.05, 0.95)).map(
    lambda u: LOWER + u * (UPPER - LOWER)
)
speeds = hnp.arrays(float, 15, elements=st.floats(-2, 2))
torques = hnp.arrays(float, 15, elements=st.floats(-500, 500, allow_nan=False))
calm = settings(max_examples=40, deadline=None)


def difference(q, k, step=1e-6):
    """Grip poses a step further and a step back in one joint."""
    out = []
    for sign in (1, -1):
        moved = q.copy()
        moved[k] += sign * step
        rotation, position = DYNAMICS.grips(moved)
        out.append((rotation.copy(), position.copy()))
    return out


@calm
@given(q=postures)
def test_jacobian_is_the_derivative_of_the_grips(q):
    """Rows 0-2 and 6-8 are dp/dq; rows 3-5 and 9-11 turn the grip: finite differences agree."""
    jacobian = DYNAMICS.terms(q).jacobian.copy()
    for k in range(15):
        (r1, p1), (r0, p0) = difference(q, k)
        for row in (0, 1):
            np.testing.assert_allclose(
                (p1 - p0)[row] / 2e-6, jacobian[6 * row : 6 * row + 3, k], atol=1e-6
            )
            turned = cartesian.rotation_vector(r1[row] @ r0[row].T) / 2e-6
            np.testing.assert_allclose(turned, jacobian[6 * row + 3 : 6 * row + 6, k], atol=1e-5)


@calm
@given(q=postures)
def test_mass_matrix_is_symmetric_and_positive(q):
    """Kinetic energy is positive in every direction."""
    mass = DYNAMICS.terms(q).mass
    np.testing.assert_array_equal(mass, mass.T)
    assert np.linalg.eigvalsh(mass).min() > 0.04  # the smallest armature is 0.05


@calm
@given(axis=hnp.arrays(float, 3, elements=st.floats(-1, 1)), angle=st.floats(0, math.pi - 1e-6))
def test_rotation_vector_inverts_the_exponential(axis, angle):
    """log(exp(w)) = w up to half a turn, where the sign of the axis is free, not the rotation."""
    assume(np.linalg.norm(axis) > 1e-3)
    vector = axis / np.linalg.norm(axis) * angle
    np.testing.assert_allclose(cartesian.rotation_vector(pin.exp3(vector)), vector, atol=1e-6)
    half = pin.exp3(axis / np.linalg.norm(axis) * math.pi)
    np.testing.assert_allclose(pin.exp3(cartesian.rotation_vector(half)), half, atol=1e-6)


@calm
@given(q=postures, ratio=st.floats(0.1, 2.0))
def test_every_mode_is_damped_by_the_ratio(q, ratio):
    """inertia x'' + D x' + K x = 0 has, in each of its modes, the damping ratio asked for."""
    terms, stiffness = DYNAMICS.terms(q), CartesianGains().task()
    inertia, _ = cartesian.task_inertia(terms.jacobian, np.linalg.inv(terms.mass))
    block = inertia[:6, :6]
    assume(np.linalg.cond(block) < 1e6)
    designed = cartesian.damping(block, stiffness, ratio)
    np.testing.assert_allclose(designed, designed.T, rtol=1e-9)
    w, modes = np.linalg.eig(np.linalg.solve(block, np.diag(stiffness)))
    # In the modes of (inertia, K) the matrix inertia^-1 D is diagonal with 2 ratio sqrt(w).
    in_modes = np.linalg.solve(modes, np.linalg.solve(block, designed) @ modes)
    expected = 2 * ratio * np.sqrt(np.abs(w))
    np.testing.assert_allclose(np.diag(in_modes).real, expected, rtol=1e-4)


@calm
@given(q=postures, torque=torques)
def test_null_space_torque_does_not_accelerate_the_hands(q, torque):
    """No more than the regularisation of the inertia leaves of J M^-1 torque: next to nothing but
    near singular postures.
    """
    terms = DYNAMICS.terms(q)
    inertia, through = cartesian.task_inertia(terms.jacobian, np.linalg.inv(terms.mass))
    left = through @ cartesian.null_space(torque, terms.jacobian, through, inertia)
    share = cartesian.REGULARISATION * np.linalg.norm(inertia, 2)
    assert share <= 1.0 + 1e-9
    assert np.linalg.norm(left) <= share * np.linalg.norm(through @ torque) + 1e-9


@calm
@given(q=postures, v=speeds)
def test_task_and_null_space_damping_takes_energy_out(q, v):
    """With no error, no torque of the law does positive work against the hands' own motion. At rest
    where it was told to be it gives none.
    """
    terms = DYNAMICS.terms(q)
    law = CartesianImpedance(CartesianGains(posture_stiffness=(0, 0), posture_damping=(0, 0)))
    tau = law.torque(terms, np.zeros(12), v, np.zeros(15), np.zeros(12))
    assert tau @ v <= 1e-9
    rest = np.zeros(15), np.zeros(15), np.zeros(12)
    assert not CartesianImpedance().torque(terms, np.zeros(12), *rest).any()


@calm
@given(
    q=postures, mass=st.floats(0.01, 2.0), lever=hnp.arrays(float, 3, elements=st.floats(-0.2, 0.2))
)
def test_payload_wrench_is_the_virtual_work_of_the_weight(q, mass, lever):
    """J^T h = m g dz/dq of the payload's centre: finite differences of its height agree."""
    terms = DYNAMICS.terms(q)
    load = np.array([mass, 0.0]), np.array([lever, np.zeros(3)])
    wrench = cartesian.payload_wrench(terms.rotation, *load)
    tau = terms.jacobian.T @ wrench
    for k in range(15):
        (r1, p1), (r0, p0) = difference(q, k)
        rise = ((r1[0] @ lever + p1[0]) - (r0[0] @ lever + p0[0]))[2] / 2e-6
        assert tau[k] == pytest.approx(mass * cartesian.GRAVITY * rise, abs=1e-4)


@calm
@given(q=postures, stray=hnp.arrays(float, 15, elements=st.floats(-0.2, 0.2)))
def test_joint_impedance_pulls_with_its_stiffness(q, stray):
    """At rest tau = K stray."""
    gains = joint.JointGains()
    tau = joint.torque(gains, DYNAMICS.terms(q), stray, np.zeros(15), np.zeros(12))
    np.testing.assert_allclose(tau, gains.diagonal() * stray, atol=1e-9)


@given(v=hnp.arrays(float, 15, elements=st.floats(allow_nan=True, allow_infinity=True)))
def test_safe_damping_is_total_and_passive(v):
    """The torque is finite, accepted, and takes energy out at any speeds. What is no number is not
    accepted: NaN compares as false, and that is the safe side.
    """
    assert not safety.is_accepted(np.full(15, np.nan))
    tau = safety.damping_torque(v)
    assert safety.is_accepted(tau)
    finite = np.isfinite(v)
    assert (np.sign(tau[finite]) * np.sign(v[finite]) <= 0).all()
    assert (tau[~finite] == 0).all()


@given(tau=torques)
def test_no_command_exceeds_what_is_accepted(tau):
    """Cut joint by joint, never turned round."""
    cut = safety.accepted(tau)
    assert safety.is_accepted(cut)
    assert (np.sign(cut) * np.sign(tau) >= 0).all()
    assert (np.abs(cut) == np.minimum(np.abs(tau), TORQUE)).all()


def test_a_torque_of_too_few_joints_is_a_mistake():
    """It is neither accepted nor turned into damping."""
    with pytest.raises(ValueError, match="longer"):
        safety.is_accepted(np.zeros(14))


def test_the_fastest_possible_speed_is_still_damped():
    """Only beyond it a speed is a fault of its sensor."""
    v = np.zeros(15)
    v[3] = safety.FASTEST
    assert safety.damping_torque(v)[3] == -TORQUE[3]
    v[3] = np.nextafter(safety.FASTEST, np.inf)
    assert safety.damping_torque(v)[3] == 0.0


@given(
    target=hnp.arrays(float, 2, elements=st.floats(-1, 1)),
    goal=hnp.arrays(float, 2, elements=st.floats(-5, 5)),
    speed=st.floats(0.01, 10),
)
def test_head_stays_in_limits_and_below_its_speed(target, goal, speed):
    """One step is at most speed * dt, ends within the limits, and comes nearer."""
    after = joint.advance_head(target, goal, speed, 0.002)
    allowed = np.clip(goal, HEAD_LOWER, HEAD_UPPER)
    assert np.linalg.norm(after - target) <= min(speed, HEAD_SPEED) * 0.002 + 1e-12
    assert np.linalg.norm(after - allowed) <= np.linalg.norm(target - allowed) + 1e-12


travel = hnp.arrays(float, (2, 3), elements=st.floats(0, 2.4))


@given(motor=travel, more=st.floats(0.01, 0.2))
def test_a_free_finger_bends_by_a_third_and_a_held_one_at_four_thirds(motor, more):
    """proximal = m gives distal = m / 3, up to the stop of the distal joint. With the proximal link
    held, further travel goes to the distal joint at 4/3 of the rate.
    """
    now, later = joint.distal_target(motor, motor), joint.distal_target(motor + more, motor)
    np.testing.assert_allclose(now, np.minimum(motor / 3, joint.DISTAL_UPPER), atol=1e-12)
    free = later < joint.DISTAL_UPPER
    np.testing.assert_allclose((later - now)[free], 4 / 3 * more, atol=1e-9)


@given(motor=travel, goal=travel, speed=st.floats(0.05, 3), stall=hnp.arrays(bool, (2, 3)))
def test_motor_keeps_its_speed_and_stalls_only_closing(motor, goal, speed, stall):
    """A stalled motor may still open."""
    after = joint.advance_fingers(motor, goal, np.full((2, 3), speed), stall, 0.002)
    assert (np.abs(after - motor) <= speed * 0.002 + 1e-12).all()
    assert (after[stall] <= motor[stall]).all()
    opening = stall & (goal < motor)
    assert (after[opening] < motor[opening]).all()


@given(motor=travel, speed=st.floats(0.05, 1))
def test_a_finger_that_lags_by_its_own_friction_touches_nothing(motor, speed):
    """Servo errors that only the motion explains do not count as touch."""
    lag = joint.PROXIMAL_LAG * speed / joint.PROXIMAL_KP
    proximal = motor - lag
    distal = motor * 4 / 3 - proximal - joint.DISTAL_LAG * speed / 3 / joint.DISTAL_KP
    assert not joint.touching(motor, proximal, distal, speed, 0.12).any()


def test_a_blocked_link_is_a_touch():
    """Either link may be the one that meets something."""
    motor, proximal, distal = (np.full((2, 3), x) for x in (1.0, 1.0, 1.0 / 3.0))
    for blocked in ((proximal - 0.05, distal + 0.05), (proximal, distal - 0.05)):
        assert joint.touching(motor, *blocked, 0.3, 0.12).all()
