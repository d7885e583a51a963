"""`python -m operate.pictures RUN_DIR GRPC WEB`: started by the monitor, which feeds it, when a
viewer connects.
"""

import socket
import sys
from pathlib import Path
from typing import Annotated

import typer

from operate.pictures import child
from operate.pictures.server import ServerError


def main(
    run: Annotated[Path, typer.Argument(help="The run's folder.")],
    grpc: Annotated[
        int, typer.Argument(help="File descriptor of the socket at which viewers connect.")
    ],
    web: Annotated[int, typer.Argument(help="That of the page.")],
) -> None:
    """Draw for Rerun what the monitor feeds on standard input; the monitor starts this."""
    try:
        ports = socket.socket(fileno=grpc), socket.socket(fileno=web)
        raise typer.Exit(child.main(run, ports, sys.stdin.fileno()))
    except (ServerError, child.OverLimit) as error:
        sys.exit(str(error))


if __name__ == "__main__":
    app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
    app.command()(main)
    app(prog_name="python -m operate.pictures")
