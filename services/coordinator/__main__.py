"""a_co, the coordinator: `python -m services.coordinator --help`."""

from agent_runtime.core.agent import Agent
from agent_runtime.io import cli, shell
from agent_runtime.io.options import Options
from companion.binding import wiring
from companion.design import AgentName
from services.coordinator.behaviours import coordinator
from services.coordinator.memory import Limits, Memory


def build(options: Options) -> Agent[Memory]:
    """The agent. Simulated time at speed "max" is taken for no slower than real time, so both wait alike."""
    return coordinator(Limits())


def serve(options: Options) -> int:
    """Run it until it is told to stop; the exit status."""
    return shell.run(build(options), wiring(AgentName.CO, options.system), options)


if __name__ == "__main__":
    cli.run("coordinator", "Takes commands of hi, has plans made by pl and carried out by ta.", serve)
