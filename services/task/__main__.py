"""ta as a process: `python -m services.task --help`."""

from agent_runtime.io import cli, shell
from agent_runtime.io.options import Options
from companion.design import AgentName, wiring
from services.task.behaviours import agent


def serve(options: Options) -> int:
    """Run until a signal; return the exit code."""
    return shell.run(agent(), wiring(AgentName.TA, options.system), options)


if __name__ == "__main__":
    cli.run("task", "ta: carries out a plan by asking ex for acts, and reports.", serve)
