"""`roco`: bring the fleet up and down, talk to the robot, watch it, ask what was said. `roco --help` lists it all.

The verbs are in services.console.verbs; docs/roco.md has the exit codes, which are the same for all.
"""

import typer

from services.console.lazy import Verbs

app = typer.Typer(
    cls=Verbs, no_args_is_help=True, help="The operator's command line of the Robot Companion.", name="roco"
)


@app.callback()
def roco() -> None:
    """The operator's command line of the Robot Companion."""


def main() -> None:
    """Entry point of `roco`."""
    app()


if __name__ == "__main__":
    main()
