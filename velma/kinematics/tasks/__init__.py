"""Geometry of the tasks: where to grip, to carry, to put down, to pour from; found by pl, solved
again by ex.

Everything here computes with postures q (15,) [rad, order of velma.names.BODY], rigid transforms
`T_a_b` (pinocchio SE3) and a collision world. Nothing here knows a language, an agent, a clock or a
true pose.
"""
