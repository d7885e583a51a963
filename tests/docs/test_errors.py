"""docs/errors.md has a row for everything that can go wrong, and none for what cannot."""

import runpy
from pathlib import Path

import pytest
import shown
import troubles

SCRIPT = runpy.run_path(str(shown.ROOT / "scripts/errors"))


def test_every_error_has_its_row_and_every_row_its_error() -> None:
    """Exceptions, loud events of the logs, drops, kinds of acts, exit codes, verdicts, states."""
    assert SCRIPT["differences"]() == []


def test_the_page_is_what_the_script_writes() -> None:
    """`scripts/errors` writes it."""
    assert SCRIPT["PAGE"].read_text(encoding="utf-8") == SCRIPT["page"]()


def test_errors_of_every_room_are_found() -> None:
    """Also those whose base is in another module, and those that nobody imports."""
    found = troubles.exceptions()
    rooms = {one.where.split("/")[1 if one.where.startswith("shared") else 0] for one in found.values()}
    assert rooms == {"fipa_codec", "agent_runtime", "topdown", "operate", "companion", "velma", "services"}
    assert {"AclSyntaxError", "KeysError", "NoRunError"} <= found.keys()
    assert found["SlotError"].message == "slot file …: …, expected …"


@pytest.fixture
def room(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A package with something new in it."""
    monkeypatch.setattr(troubles, "ROOT", tmp_path)
    monkeypatch.setattr(troubles, "ROOMS", ("room",))
    (tmp_path / "room/deep").mkdir(parents=True)
    return tmp_path / "room/deep/module.py"


@pytest.mark.parametrize(
    ("code", "name"),
    [
        ("class New(Exception): ...", "New"),
        ("class Base(ValueError): ...\nclass New(Base): ...", "New"),
        ("class New(other.Base): ...\nclass Base(OSError): ...", "New"),
        ("def f():\n    class New(Exception): ...", "New"),
    ],
)
def test_a_new_exception_is_seen(room: Path, code: str, name: str) -> None:
    """The place and the name of the base do not matter."""
    room.write_text(code, encoding="utf-8")
    assert name in troubles.exceptions()


@pytest.mark.parametrize(
    "code",
    [
        "def f(log): log.write('new', level='warning')",
        "def f(log): log.write('new' if x else 'old', level='error' if x else 'info')",
        "def f(log):\n    what = 'new'\n    log.write(what, level='error')",
        "def f(log):\n    level = 'info' if x else 'warning'\n    log.write('new', level=level)",
        "def f(log):\n    why, level = ('w', 'warning') if x else ('i', 'info')\n    log.write('new', level=level)",
        "def f(log):\n    words = ('old', 'info') if x else ('new', 'warning')\n    log.write(*words)",
    ],
)
def test_a_new_loud_event_is_seen(room: Path, code: str) -> None:
    """Whether its level is said in the call, chosen there, or carried by a variable."""
    room.write_text(code, encoding="utf-8")
    assert "new" in troubles.warnings()


def test_a_quiet_event_is_none(room: Path) -> None:
    """An event logged as info is not an error."""
    room.write_text("def f(log): log.write('new', level='info'); log.write('newer')", encoding="utf-8")
    assert troubles.warnings() == {}


def test_drops_are_called_what_the_runtime_calls_them() -> None:
    """The two that are members of an enumeration."""
    from agent_runtime.core.sequence_check import What

    assert {f"What.{one.name}": one.value for one in (What.DROP, What.REFUSE)} == troubles.DROPS
