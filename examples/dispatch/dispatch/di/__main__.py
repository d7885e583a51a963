"""di as a process: `python -m dispatch.di --help`."""

import sys

from agent_runtime.core.binding import wiring
from agent_runtime.io import cli, shell
from agent_runtime.io.options import USAGE_ERROR, Options

from dispatch.design import DESIGN, LANGUAGES
from dispatch.di.behaviours import agent
from dispatch.di.people import people
from dispatch.orders import read


def serve(options: Options) -> int:
    """Until a signal comes. `--scene`: the file of robots and orders."""
    wired = wiring("di", options.system, design=DESIGN, languages=LANGUAGES)
    try:
        orders = read(options.scene).order
    except ValueError as error:
        print(error, file=sys.stderr)
        return USAGE_ERROR
    return shell.run(agent(), wired, options, people(orders))


if __name__ == "__main__":
    cli.run("di", "di: puts orders out to tender among robots.", serve)
