"""km as a process: `python -m services.knowledge --help`."""

from agent_runtime.io import cli, shell
from agent_runtime.io.options import Options
from companion.design import AgentName, wiring
from services.knowledge.behaviours import agent
from services.knowledge.guests import with_guests
from services.knowledge.store import device_at


def serve(options: Options) -> int:
    """Run until a signal; return the exit code."""
    device = with_guests(device_at(options.run_dir / "knowledge"))
    return shell.run(agent(), wiring(AgentName.KM, options.system), options, device)


if __name__ == "__main__":
    what = "km: knows what was observed; answers queries, keeps hypothetical states."
    cli.run("knowledge", what, serve)
