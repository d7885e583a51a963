"""a_ta as a process: `python -m services.task --help`."""

from agent_runtime.io import cli, shell
from agent_runtime.io.options import Options
from companion.binding import wiring
from services.task import behaviours


def serve(options: Options) -> int:
    """Until a signal comes."""
    return shell.run(behaviours.agent(), wiring("ta", options.system), options)


if __name__ == "__main__":
    cli.run("task", "a_ta: carries out a plan by asking ex for acts, and reports.", serve)
