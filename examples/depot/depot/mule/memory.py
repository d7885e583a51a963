"""Initial memory of a_mule; the rest of it is the carrier's, which both robots share."""

from depot.carrier.memory import Memory
from depot.world import STATIONS

FIRST = Memory(home="mule_home", speed=4.0, here=STATIONS["mule_home"])
"""Speed in m/s: estimate, so that a person can follow it."""
