"""pl as a process: `python -m services.planner --help`."""

from agent_runtime.io import cli, shell
from agent_runtime.io.options import Options
from companion.design import AgentName, wiring
from services.planner.behaviours import agent
from services.planner.search import SearchDevice


def serve(options: Options) -> int:
    """Run until a signal; return the exit code."""
    return shell.run(
        agent(options.seed), wiring(AgentName.PL, options.system), options, SearchDevice
    )


if __name__ == "__main__":
    cli.run("planner", "pl: makes a plan for a task network, from what km knows.", serve)
