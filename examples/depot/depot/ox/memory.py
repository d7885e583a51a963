"""Initial memory of a_ox; the rest of it is the carrier's, which both robots share."""

from depot.carrier.memory import Memory
from depot.world import STATIONS

FIRST = Memory(home="ox_home", speed=3.0, here=STATIONS["ox_home"])
"""Speed in m/s: estimate, so that a person can follow it."""
