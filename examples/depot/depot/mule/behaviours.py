"""a_mule: a carrier with a memory of its own."""

from agent_runtime.core.agent import Agent

from depot.carrier.behaviours import carrier
from depot.carrier.memory import Memory
from depot.mule.memory import FIRST


def agent() -> Agent[Memory]:
    """The agent mule."""
    return carrier("mule", FIRST)
