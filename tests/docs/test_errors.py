"""docs/errors.md has a row for everything that can go wrong, and none for what cannot."""

import re
import runpy
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import shown
import troubles

SCRIPT = runpy.run_path(str(shown.ROOT / "scripts/errors"))


@pytest.mark.timeout(180)  # all of the code is read
def test_every_error_has_its_row_and_every_row_its_error() -> None:
    """Exceptions, loud events of the logs, drops, kinds of acts, exit codes, verdicts, states;
    `scripts/errors`.
    """
    assert SCRIPT["differences"]() == []
    assert SCRIPT["PAGE"].read_text(encoding="utf-8") == SCRIPT["page"]()


def test_the_page_of_the_judge_has_every_verdict() -> None:
    """The page of the errors says only what to do about them."""
    text = (shown.ROOT / "docs/conversations.md").read_text(encoding="utf-8")
    rows = {row.strip("`") for row in re.findall(r"^\| ([\w` ]+) \| ", text, re.MULTILINE)}
    assert troubles.every()["verdicts"].keys() - rows == set()


def test_errors_of_every_room_are_found() -> None:
    """Also those whose base is in another module, and those that nobody imports."""
    found = troubles.exceptions()
    rooms = {
        one.where.split("/")[1 if one.where.startswith("shared") else 0] for one in found.values()
    }
    assert rooms == {
        "fipa_codec",
        "agent_runtime",
        "topdown",
        "operate",
        "console",
        "companion",
        "velma",
        "services",
    }
    assert {"AclSyntaxError", "KeysError", "NoRunError"} <= found.keys()
    assert found["SlotError"].message == "slot file …: …, expected …"


@pytest.fixture
def room(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A package with something new in it."""
    monkeypatch.setattr(troubles, "ROOT", tmp_path)
    monkeypatch.setattr(troubles, "ROOMS", ("room",))
    monkeypatch.setattr(troubles, "_parsed", troubles._parsed.__wrapped__)  # not cached
    (tmp_path / "room/deep").mkdir(parents=True)
    return tmp_path / "room/deep/module.py"


def test_a_new_exception_is_seen(room: Path) -> None:
    """The place and the name of the base do not matter."""
    for code in (
        "class New(Exception): ...",
        "class Base(ValueError): ...\nclass New(Base): ...",
        "class New(other.Base): ...\nclass Base(OSError): ...",
        "def f():\n    class New(Exception): ...",
    ):
        assert "New" in seen(room, code, troubles.exceptions), code


def test_a_new_loud_event_is_seen(room: Path) -> None:
    """Whether its level is said in the call, chosen there, or carried by a variable."""
    for code in (
        "def f(log): log.write('new', level='warning')",
        "def f(log): log.write('new' if x else 'old', level='error' if x else 'info')",
        "def f(log):\n    what = 'new'\n    log.write(what, level='error')",
        "def f(log):\n    level = 'info' if x else 'warning'\n    log.write('new', level=level)",
        (
            "def f(log):\n    why, level = ('w', 'warning') if x else ('i', 'info')\n   "
            " log.write('new', level=level)"
        ),
        (
            "def f(log):\n    words = ('old', 'info') if x else ('new', 'warning')\n   "
            " log.write(*words)"
        ),
    ):
        assert "new" in seen(room, code, troubles.warnings), code


def seen(room: Path, code: str, find: Callable[[], dict[str, Any]]) -> dict[str, Any]:
    """What is found in a package of this code."""
    room.write_text(code, encoding="utf-8")
    return find()


def test_a_quiet_event_is_none(room: Path) -> None:
    """An event logged as info is not an error."""
    room.write_text(
        "def f(log): log.write('new', level='info'); log.write('newer')", encoding="utf-8"
    )
    assert troubles.warnings() == {}


def test_drops_are_called_what_the_runtime_calls_them() -> None:
    """The two that are members of an enumeration."""
    from agent_runtime.core.reception import What

    assert {f"What.{one.name}": one.value for one in (What.DROP, What.REFUSE)} == troubles.DROPS
