"""a_ox: a carrier with a memory of its own."""

from agent_runtime.core.agent import Agent

from depot.carrier.behaviours import carrier
from depot.carrier.memory import Memory
from depot.ox.memory import FIRST


def agent() -> Agent[Memory]:
    """The agent ox."""
    return carrier("ox", FIRST)
