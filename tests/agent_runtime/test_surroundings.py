"""Logs, inbox and command line: what stands around the core."""

import io
import json
from pathlib import Path
from unittest.mock import MagicMock

import pytest
from toy_agents import wirings
from typer.testing import CliRunner

from agent_runtime.core.wiring import Delivery
from agent_runtime.io import cli
from agent_runtime.io.inbox import BOUNDS, Class, Inbox
from agent_runtime.io.logs import Log
from agent_runtime.io.options import Options
from agent_runtime.io.zenoh_wire import KNOWN_KEYS, ZenohWire


def test_a_log_line_is_json_in_the_file_and_short_on_the_console(tmp_path: Path) -> None:
    """The file has every line with its fields; the console what the level asks for, conversation last."""
    console = io.StringIO()
    log = Log("ta", "info", tmp_path / "logs" / "ta.jsonl", console)
    log.write("sent", performative="inform", peer="co", bytes=None, conversation="co-1-4")
    log.write("detail", "debug", x=1)
    log.write("garbled", "warning", why="no communicate")
    log.close()
    lines = [json.loads(line) for line in (tmp_path / "logs" / "ta.jsonl").read_text().splitlines()]
    assert [line["event"] for line in lines] == ["sent", "detail", "garbled"]
    assert all(line["agent"] == "ta" and line["t"] > 0 for line in lines)
    assert lines[0]["conversation"] == "co-1-4"
    shown = console.getvalue().splitlines()
    assert shown[0].split(maxsplit=1)[1] == "ta     sent performative=inform peer=co co-1-4"
    assert len(shown) == 2
    assert "! garbled" in shown[1]


def test_the_inbox_is_bounded_by_class() -> None:
    """Beyond its bound a class drops and counts; control is never dropped, and taking makes room."""
    inbox = Inbox()
    taken = [inbox.put(Class.STREAM, number) for number in range(BOUNDS[Class.STREAM] + 2)]
    assert taken.count(False) == 2
    assert inbox.dropped == {Class.STREAM: 2}
    assert all(inbox.put(Class.CONTROL, None) for _ in range(5000))
    assert inbox.get(0.0) == 0
    assert inbox.put(Class.STREAM, "again")


def test_an_empty_inbox_gives_none_in_time() -> None:
    """No entry, also for a time in the past: None at once."""
    assert Inbox().get(-5.0) is None


def test_what_comes_on_a_key_is_classed_by_its_link_and_strangers_fill_no_memory() -> None:
    """Durable links are streams, all else may be dropped sooner; so many keys are kept and no more."""
    for delivery, kind in ((Delivery.DURABLE, Class.STREAM), (Delivery.VOLATILE, Class.VOLATILE)):
        _, to_asker = wirings(delivery)
        (link,) = to_asker.links
        inbox = Inbox()
        wire = ZenohWire(MagicMock(), to_asker, 1, inbox)
        key = f"roco/toy/{link.channel}/{link.peer}/{to_asker.agent}/{link.protocol}/"
        for act in ("request", "request", *map(str, range(KNOWN_KEYS + 5))):
            wire._on_communicate(MagicMock(key_expr=key + act))
        assert set(inbox._waiting) == {kind}
        assert len(wire._known) == KNOWN_KEYS
        wire._on_communicate(MagicMock(key_expr=f"roco/toy/{link.channel}/stranger/{to_asker.agent}/x/request"))
        assert inbox._waiting[Class.VOLATILE] > 0


@pytest.fixture(autouse=True)
def _no_variables(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("CONNECT", "LISTEN", "SYSTEM", "RUN_DIR", "LOG_LEVEL", "SPEED", "SEED", "SCENE"):
        monkeypatch.delenv(f"ROCO_{name}", raising=False)


def parsed(arguments: list[str], environment: dict[str, str] | None = None) -> tuple[int, Options | None]:
    """Exit status, and what a service would get."""
    got: list[Options] = []
    result = CliRunner().invoke(cli.app("x", "A service.", got.append), arguments, env=environment)
    return result.exit_code, got[0] if got else None


def test_defaults_variables_and_options() -> None:
    """Nothing said: the defaults; a variable is heard; an option wins over it."""
    assert parsed([]) == (0, Options())
    variables = {"ROCO_SYSTEM": "robot1", "ROCO_SPEED": "max", "ROCO_SEED": "7", "ROCO_SCENE": ""}
    assert parsed([], variables) == (0, Options(system="robot1", speed="max", seed=7))
    status, options = parsed(["--system", "robot2", "--run-dir", "r", "--scene", "s.toml"], variables)
    assert (status, options) == (
        0,
        Options(system="robot2", speed="max", seed=7, run_dir=Path("r"), scene=Path("s.toml")),
    )


@pytest.mark.parametrize("arguments", [["--speed", "fast"], ["--seed", "x"], ["--nothing"], ["--log-level", "loud"]])
def test_a_wrong_option_is_status_2(arguments: list[str]) -> None:
    """Which no supervisor tries again."""
    assert parsed(arguments) == (2, None)


def test_the_status_is_the_services() -> None:
    """What serve gives is how the process ends."""
    assert CliRunner().invoke(cli.app("x", "A service.", lambda options: 3), []).exit_code == 3
