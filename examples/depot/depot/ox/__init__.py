"""a_ox. The robot ox: offers to carry, drives and carries; a group that stays one: agent, wheels,
odometry.
"""
