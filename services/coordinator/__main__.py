"""co as a process: `python -m services.coordinator --help`."""

from agent_runtime.io import cli, shell
from agent_runtime.io.options import Options
from companion.design import AgentName, wiring
from services.coordinator.behaviours import agent


def serve(options: Options) -> int:
    """Run until a signal; return the exit code."""
    return shell.run(agent(), wiring(AgentName.CO, options.system), options)


if __name__ == "__main__":
    what = "co: takes commands of hi, has plans made by pl and carried out by ta."
    cli.run("coordinator", what, serve)
