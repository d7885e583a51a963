"""a_pl as a process: `python -m services.planner --help`."""

from agent_runtime.io import cli, shell
from agent_runtime.io.options import Options
from companion.binding import wiring
from services.planner import behaviours
from services.planner.searcher import Searcher


def serve(options: Options) -> int:
    """Until a signal comes."""
    return shell.run(behaviours.agent(options.seed), wiring("pl", options.system), options, Searcher)


if __name__ == "__main__":
    cli.run("planner", "a_pl: makes a plan for a task network, from what km knows.", serve)
