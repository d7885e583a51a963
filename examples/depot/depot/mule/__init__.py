"""a_mule. The robot mule: offers to carry, drives and carries; a group that stays one: agent,
wheels, odometry.
"""
