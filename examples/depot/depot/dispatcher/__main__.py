"""a_dispatcher as a process: `python -m depot.dispatcher --help`."""

from agent_runtime.core.binding import wiring
from agent_runtime.io import cli, shell
from agent_runtime.io.options import Options

from depot.design import DESIGN, LANGUAGES
from depot.dispatcher.behaviours import agent


def serve(options: Options) -> int:
    """Run until a signal; a device of the agent (agent_runtime.io.devices) would be the last
    argument of `run`.
    """
    wired = wiring("dispatcher", options.system, design=DESIGN, languages=LANGUAGES)
    return shell.run(agent(), wired, options)


if __name__ == "__main__":
    cli.run(
        "dispatcher",
        "a_dispatcher. Puts each order out to tender among the robots, and awards it to the one ...",
        serve,
    )
