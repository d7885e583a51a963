"""A bidder as a process."""

import sys

from agent_runtime.core.binding import wiring
from agent_runtime.io import cli, shell
from agent_runtime.io.options import USAGE_ERROR, Options

from dispatch.bidder.behaviours import bidder
from dispatch.bidder.device import device
from dispatch.design import DESIGN, LANGUAGES
from dispatch.orders import read


def run(name: str, robot: str) -> None:
    """Until a signal comes. `--scene`: the file of robots and orders."""

    def serve(options: Options) -> int:
        wired = wiring(name, options.system, design=DESIGN, languages=LANGUAGES)
        try:
            made = device(name, robot, read(options.scene).robots)
        except ValueError as error:
            print(error, file=sys.stderr)
            return USAGE_ERROR
        return shell.run(bidder(name, robot), wired, options, made)

    cli.run(name, f"{name}: bids for {robot}.", serve)
