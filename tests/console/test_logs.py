"""`roco logs`: all agents' files as one stream, from a moment on, from a level on."""

import json
import time
from pathlib import Path
from typing import Any

import msgspec
import pytest

from agent_runtime.io.cli import Level
from agent_runtime.io.logs import Log
from console.errors import UsageError
from console.fleet.local import Local
from console.fleet.logs import Written, logs, moment
from console.output import Format
from operate.file_names import FLEET_FILE
from operate.fleet_file import Fleet


@pytest.fixture
def run(tmp_path: Path) -> Path:
    """A run of the robot in which co and ta write in turns, every 10 s."""
    told = Fleet("roco", "", 0, 0.0, (), entry="companion.tools.system:SYSTEM")
    (tmp_path / FLEET_FILE).write_bytes(msgspec.json.encode(told))
    for name, begin, level in (("co", 1000.0, "info"), ("ta", 1005.0, "debug")):
        log = Log(name, "error", tmp_path / "logs" / f"{name}.jsonl")
        log.write_all(
            [(begin + 10 * each, f"{name}{each}", level, {"peer": "x"}) for each in range(3)]
        )
        log.close()
    return tmp_path


def test_all_agents_are_one_stream_in_the_order_of_time(run: Path) -> None:
    """Though each file has only its own."""
    events = ["co0", "ta0", "co1", "ta1", "co2", "ta2"]
    assert [line.event for line in Written(Local(run)).new()] == events


def test_each_line_is_told_once_and_only_when_it_is_whole(run: Path) -> None:
    """A half-written line waits for its end."""
    written = Written(Local(run), "co")
    assert len(written.new()) == 3
    with (run / "logs" / "co.jsonl").open("ab") as file:
        file.write(b'{"agent":"co","t":1100.0,"level":"in')
        file.flush()
        assert written.new() == []
        file.write(b'fo","event":"more"}\n')
    assert [line.event for line in written.new()] == ["more"]
    assert written.new() == []


def test_a_log_that_began_anew_is_read_from_its_beginning(run: Path) -> None:
    """A full log is moved away: what stands in the new one is told, once."""
    written = Written(Local(run), "co")
    assert len(written.new()) == 3
    (run / "logs" / "co.jsonl").write_bytes(
        b'{"agent":"co","t":1100.0,"level":"info","event":"new"}\n'
    )
    assert [line.event for line in written.new()] == ["new"]
    assert written.new() == []


def test_level_and_since_leave_the_rest_out(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """From info on ta's are none; from a time on the older ones are none."""

    def events(**options: Any) -> list[str]:
        logs(run_dir=run, form=Format.JSON, **options)
        return [json.loads(line)["event"] for line in capsys.readouterr().out.splitlines()]

    assert events(level=Level.INFO, since="", lines=0) == ["co0", "co1", "co2"]
    since = time.strftime("%Y-%m-%dT%H:%M:%S", time.localtime(1011.0))
    assert events(level=Level.DEBUG, since=since) == ["ta1", "co2", "ta2"]
    logs(level=Level.DEBUG, since="", lines=1, run_dir=run)
    assert "ta ta2 peer=x" in capsys.readouterr().out


def test_since_takes_a_length_of_time_or_a_time_of_the_day() -> None:
    """As docker logs does; a time is of today."""
    for text, ago in {"30s": 30.0, "1.5m": 90.0, "2h": 7200.0, "1d": 86400.0}.items():
        assert moment(text, 1e9) == 1e9 - ago, text
    now = time.mktime((2026, 11, 23, 14, 30, 0, 0, 0, -1))
    assert moment("14:05", now) == now - 25 * 60
    assert moment("14:29:58", now) == now - 2


def test_what_is_not_a_time_or_a_name_is_told_with_what_would_be(run: Path) -> None:
    """Both are wrong use."""
    with pytest.raises(UsageError, match="yesterday is not a time; write 30s"):
        moment("yesterday", 0.0)
    with pytest.raises(UsageError, match=r"no log of 'zz' in .*; there are: co, ta"):
        Written(Local(run), "zz")
