"""`roco send` before anything is said: what the design has is listed, what it has not is named;
`roco acl show` says what a message says.
"""

import json
from functools import partial
from pathlib import Path
from typing import Any

import msgspec
import pytest
from calling import printed, roco

from companion.design import DESIGN

COMMAND = ("--as", "hi", "--to", "co", "--protocol", "request", "--performative", "request")


def run(*words: str) -> tuple[int, str, str]:
    """Exit code, standard output, standard error."""
    done = roco("send", *words, columns=80)
    return done.exit_code, done.stdout, done.stderr


def listed(*words: str) -> list[Any]:
    """The list, for programs."""
    code, out, _ = run("--list", "--format", "json", *words)
    assert code == 0
    return msgspec.json.decode(out)


def test_everything_that_may_be_said_is_listed() -> None:
    """All rules for agents; fewer, the more is chosen."""
    guests = {one.name for one in DESIGN.file.guest}
    assert len(listed()) == sum(not guests & {s, r} for s, r, _, _ in DESIGN.rules)
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


# --- `roco acl show`: what a message says, or a caret under what is wrong with it. ----------------


MESSAGE = (
    "(inform :sender (agent-identifier :name km :addresses (sequence http://a:1/acc)) :receiver"
    ' (set (agent-identifier :name pl) (agent-identifier :name ta)) :content "{\\"a\\":1}"'
    " :encoding json :reply-by 20260101T120000250Z :X-id km-1)"
)


show = partial(roco, "acl", "show")


def test_text_file_and_standard_input_show_the_same(tmp_path: Path) -> None:
    """A row for each parameter: agents with addresses, JSON indented, times in words."""
    path = tmp_path / "message.acl"
    path.write_text(MESSAGE)
    said = show(MESSAGE, code=0)
    rows = [line.rstrip().split(maxsplit=1) for line in said.stdout.splitlines()]
    assert rows[:4] == [
        ["performative", "inform"],
        ["sender", "km  http://a:1/acc"],
        ["receiver", "pl"],
        ["receiver", "ta"],
    ]
    assert ["reply-by", "2026-01-01 12:00:00.250 UTC"] in rows
    assert '"a": 1' in said.stdout
    assert show(str(path)).stdout == show("-", stdin=MESSAGE.encode()).stdout == said.stdout


def test_json_for_programs() -> None:
    """The same names as in Python."""
    said = printed("acl", "show", MESSAGE)
    assert said["receiver"] == [{"name": "pl"}, {"name": "ta"}]
    assert said["reply_by"] == {"type": "At", "unix_ms": 1_767_268_800_250}


@pytest.mark.parametrize(
    ("text", "fault", "before"),
    [
        ("(inform :mood good)", ":mood", 8),
        ("(inform\n  :content hi :mood good)", ":mood", 14),
        ('(inform\t:content "é" :mood good)', ":mood", 21),
        ('(inform :content "本" :mood good)', ":mood", 22),
    ],
)
def test_a_caret_points_at_the_fault(text: str, fault: str, before: int) -> None:
    """Under its first character as a terminal shows the line; wide characters take two cells."""
    said = show(text, code=1)
    sentence, line, caret = said.stderr.splitlines()
    assert "expected one of :sender" in sentence
    assert caret == " " * (2 + before) + "^"
    assert line.endswith(f"{fault} good)")


def test_a_fault_for_programs() -> None:
    """The fields of the error, the sentence among them."""
    said = show("(inform :mood good)", "--format", "json", code=1)
    fault = json.loads(said.stderr)
    assert (fault["line"], fault["column"], fault["offset"], fault["found"]) == (1, 9, 8, "':mood'")


def test_a_terminal_obeys_no_message() -> None:
    """Control characters are shown, not sent; neither are rich's tags."""
    for text in (
        '(inform :content "a\x1b[2Jb" :language "[red]x[/red]")',
        '(inform :content "a\x1b[2Jb" :mood x)',
    ):
        said = show(text)
        assert "\x1b" not in said.stdout + said.stderr
        assert "[2Jb" in said.stdout + said.stderr
    assert "[red]x[/red]" in show('(inform :language "[red]x[/red]")').stdout


def test_neither_text_nor_file_is_wrong_usage(tmp_path: Path) -> None:
    """Exit code 2 and both readings named."""
    for source in ("inform", str(tmp_path), "x" * 5000, "a\0b"):
        show(source, code=2)
    assert "begins with (" in show("inform").stderr
