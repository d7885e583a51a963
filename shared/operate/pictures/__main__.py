"""`python -m operate.pictures RUN_DIR BIND GRPC_PORT WEB_PORT`: started by the monitor, which feeds it."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from operate.pictures import child
from operate.pictures.server import ServerError
from operate.pictures.viewer_address import Place


def main(
    run: Annotated[Path, typer.Argument(help="The run's folder.")],
    bind: Annotated[str, typer.Argument(help="The address that Rerun's server listens at.")],
    grpc: Annotated[int, typer.Argument(help="Port for viewers.")],
    web: Annotated[int, typer.Argument(help="Port of the page.")],
) -> None:
    """Draw for Rerun what the monitor feeds on standard input; the monitor starts this."""
    try:
        raise typer.Exit(child.main(run, Place(bind, grpc, web), sys.stdin.fileno()))
    except (ServerError, child.OverLimit) as error:
        sys.exit(str(error))


if __name__ == "__main__":
    app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)
    app.command()(main)
    app(prog_name="python -m operate.pictures")
