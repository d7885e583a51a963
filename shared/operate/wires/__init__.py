"""Wires between agents and router that can be cut and disturbed: a TCP proxy; clocks of agents that
can be stepped.
"""
