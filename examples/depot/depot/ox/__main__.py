"""a_ox as a process: `python -m depot.ox --help`."""

from agent_runtime.core.binding import wiring
from agent_runtime.io import cli, shell
from agent_runtime.io.options import Options

from depot.carrier.wheels import wheels
from depot.design import DESIGN, LANGUAGES
from depot.ox.behaviours import agent


def serve(options: Options) -> int:
    """Until a signal comes."""
    wired = wiring("ox", options.system, design=DESIGN, languages=LANGUAGES)
    return shell.run(agent(), wired, options, wheels)


if __name__ == "__main__":
    cli.run("ox", "a_ox. The robot ox: offers to carry, drives and carries; a group that stays one: ...", serve)
