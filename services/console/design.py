"""`roco design`: the design file checked, shown, proven before it runs. Each verb is in a module of its own."""

import typer

app = typer.Typer(no_args_is_help=True, help="The design: checked, shown, proven.")
