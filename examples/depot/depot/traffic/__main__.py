"""a_traffic as a process: `python -m depot.traffic --help`."""

from agent_runtime.core.binding import wiring
from agent_runtime.io import cli, shell
from agent_runtime.io.options import Options

from depot.design import DESIGN, LANGUAGES
from depot.traffic.behaviours import agent


def serve(options: Options) -> int:
    """Run until a signal; a device of the agent (agent_runtime.io.devices) would be the last
    argument of `run`.
    """
    wired = wiring("traffic", options.system, design=DESIGN, languages=LANGUAGES)
    return shell.run(agent(), wired, options)


if __name__ == "__main__":
    cli.run("traffic", "a_traffic. Lets one robot at a time into the aisle.", serve)
