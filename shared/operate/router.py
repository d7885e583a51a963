"""A system's router: a Zenoh router opened from Python (as fast as the stand-alone one, and nothing
to install).

It listens, says so by `router.ready` in the run folder and a line, and waits for a signal. No agent
may live in this process: the router's access rules would not hold for it.
"""

from agent_runtime.io import cli
from agent_runtime.io.sessions import serve


def main() -> None:
    """Serve as the router until a signal; ends the process."""
    cli.run("router", "The fleet's Zenoh router.", serve)


if __name__ == "__main__":
    main()
