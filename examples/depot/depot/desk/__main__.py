"""a_desk as a process: `python -m depot.desk --help`."""

from agent_runtime.core.binding import wiring
from agent_runtime.io import cli, shell
from agent_runtime.io.options import Options

from depot.design import DESIGN, LANGUAGES
from depot.desk.behaviours import agent
from depot.desk.people import people, read


def serve(options: Options) -> int:
    """Until a signal comes. `--scene`: a file of orders, else orders.toml."""
    wired = wiring("desk", options.system, design=DESIGN, languages=LANGUAGES)
    return shell.run(agent(), wired, options, people(read(options.scene)))


if __name__ == "__main__":
    cli.run("desk", "a_desk. Takes orders of people, one after the other, and tells what became of them.", serve)
