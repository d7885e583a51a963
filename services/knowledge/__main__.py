"""a_km as a process: `python -m services.knowledge --help`."""

from agent_runtime.io import cli, shell
from agent_runtime.io.options import Options
from companion.binding import wiring
from services.knowledge import behaviours, mirror


def serve(options: Options) -> int:
    """Until a signal comes."""
    device = mirror.at(options.run_dir / "knowledge")
    return shell.run(behaviours.agent(), wiring("km", options.system), options, device)


if __name__ == "__main__":
    cli.run("knowledge", "a_km: knows what was observed; answers queries, keeps hypothetical states.", serve)
