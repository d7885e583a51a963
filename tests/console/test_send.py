"""`roco send` before anything is said: what the design has is listed, what it has not is named."""

from typing import Any

import msgspec
import pytest
import typer
from typer.testing import CliRunner

from companion.design import DESIGN
from console.traffic.send import send

COMMAND = ("--as", "hi", "--to", "co", "--protocol", "request", "--performative", "request")


def run(*words: str) -> tuple[int, str, str]:
    """Exit code, standard output, standard error."""
    app = typer.Typer()
    app.command()(send)
    done = CliRunner().invoke(app, list(words), env={"COLUMNS": "80"})
    return done.exit_code, done.stdout, done.stderr


def listed(*words: str) -> list[Any]:
    """The list, for programs."""
    code, out, _ = run("--list", "--format", "json", *words)
    assert code == 0
    return msgspec.json.decode(out)


def test_everything_that_may_be_said_is_listed() -> None:
    """All rules of the design; fewer, the more is chosen."""
    assert len(listed()) == len(DESIGN.rules)
    assert {rule["receiver"] for rule in listed("--as", "hi")} == {"co"}
    assert len(listed(*COMMAND)) == 1


def test_the_list_fits_the_terminal() -> None:
    """And names contents and sizes."""
    _, out, _ = run("--list", "--as", "hi")
    assert "CMD.PourInto" in out
    assert "250 B" in out
    assert max(map(len, out.splitlines())) <= 80


def test_what_is_not_chosen_is_asked_for() -> None:
    """Exit code 2, with what there is to choose from."""
    code, out, error = run("--as", "hi")
    assert code == 2
    assert "--to, --protocol, --performative" in error
    assert "request" in out


@pytest.mark.parametrize(
    ("words", "wrong"),
    [
        (("--as", "spy", *COMMAND[2:]), "--as 'spy'"),
        ((*COMMAND[:2], "--to", "ex", *COMMAND[4:]), "--to 'ex'"),
        ((*COMMAND[:4], "--protocol", "query", *COMMAND[6:]), "--protocol 'query'"),
        ((*COMMAND[:6], "--performative", "agree"), "--performative 'agree'"),
        ((*COMMAND, "--content", "{"), "no JSON"),
        ((*COMMAND, "--content", '{"type":"TaskReport","state":"done"}'), "carries CMD.PourInto"),
        ((*COMMAND, "--language", "RC", "--content", "{}"), "RC"),
        (COMMAND, "no content"),
    ],
)
def test_what_the_design_has_not_is_named(words: tuple[str, ...], wrong: str) -> None:
    """Exit code 2, and nothing is said."""
    code, out, error = run(*words)
    assert (code, out) == (2, "")
    assert wrong in error
