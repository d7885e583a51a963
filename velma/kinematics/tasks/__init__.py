"""Geometry of the tasks: where to grip, to carry, to put down, to pour from; found by pl, solved
again by ex.

Everything here computes with postures q (15,) [rad, order of velma.names.BODY], rigid transforms
`T_a_b` (pinocchio SE3) and a collision world. Nothing here knows a language, an agent, a clock or a
true pose.
"""

# Speeds of the grip [m/s]: pl computes durations by them, ex moves by them. From task runs with the
# true robot model where nothing else is said.

# free motions, with empty hands and with something in one of them
EMPTY_SPEED, LOADED_SPEED = 0.35, 0.25
APPROACH_SPEED, LIFT_SPEED, DOWN_SPEED, RETREAT_SPEED = 0.2, 0.1, 0.04, 0.15
PULL_SPEED = 0.12  # of the handle of a leaf; estimate: one of 1.7 kg then pulls with less than 2 N
TILT_SPEED, BACK_SPEED = 0.25, 0.35  # of the pouring hand, and back again
LOOK_SPEED = 1.0  # of the head [rad/s]; it may turn at 1.04
