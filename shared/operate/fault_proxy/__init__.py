"""A TCP proxy between agents and router whose wires can be cut and disturbed; clocks of agents that
can be stepped.
"""
