"""Nothing that others wrote makes a terminal do anything: contents, names, ids, folders, in text
and in JSON.
"""

import io
import json
import sys
from pathlib import Path

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st
from planting import Traffic
from planting import content as saying
from rich.table import Table
from rich.text import Text
from typer.testing import CliRunner

from companion.languages import cmd, hfsm
from companion.tools.system import SYSTEM
from console import completion, lazy
from console.__main__ import app
from console.terminal.console import Console
from operate.file_names import FLEET_FILE, TRAFFIC_FILE, VERDICTS_FILE
from operate.fleet_file import Fleet, ProcessState, ProcessStatus
from operate.recording.mcap_file import Recording
from operate.recording.records import understood
from operate.verdict_lines import Judged
from operate.wording import escaped, one_line

TITLE = "\x1b]0;pwned\x07"
TURNED = "\u202etxet\u2066\u200f"
C1 = "\x9b2J\x9d0;pwned\x9c\x7f"
EVIL = f"{TITLE}{TURNED}{C1}\rover"
BELOW = "\n00:00:00.000 C1 a line of its own"
SEEN = "\\u001b]0;pwned\\u202etxet"
"""As people see it; rich leaves the bell out."""


def obeyed(text: str) -> list[str]:
    """What is in a text that a terminal obeys, but line ends."""
    return [
        c
        for c in text
        if (ord(c) < 32 and c != "\n") or 0x7F <= ord(c) < 0xA0 or c in "\u202e\u2066\u200f"
    ]


@pytest.fixture
def run(tmp_path: Path) -> Path:
    """A recorded pour in which one says a control sequence; its folder, a process and a note are
    called so, too.
    """
    traffic, folder = Traffic(), tmp_path / f"run{TITLE}{TURNED}"
    folder.mkdir()
    place = hfsm.Place(("x",), hfsm.Step(EVIL + BELOW))
    report = cmd.TaskReport(state=cmd.TaskState.RUNNING, at=place)
    traffic.edit(traffic.said("co", "hi", "inform"), **saying(report))
    traffic.edit(traffic.said("ta", "co", "inform"), conversation=f"c{EVIL}")
    recording = Recording(folder / TRAFFIC_FILE)
    for item in traffic.items:
        recording.add(understood(item, SYSTEM) if hasattr(item, "key") else item)
    recording.finish()
    status = ProcessStatus(f"co{EVIL}", ProcessState.GIVEN_UP, note=EVIL)
    told = Fleet(f"roco{EVIL}", f"tcp/{EVIL}", 0, 0.0, (status,), "companion.tools.system:SYSTEM")
    said = ("C1", "ta", "co", "coordinate", "inform", f"c{EVIL}")
    judged = Judged(0.0, "legal", 1, *said, text=EVIL, why=EVIL)
    (folder / VERDICTS_FILE).write_bytes(msgspec.json.encode(judged))
    (folder / FLEET_FILE).write_bytes(msgspec.json.encode(told))
    return folder


@pytest.mark.process
@pytest.mark.parametrize(
    ("words", "has"),
    [
        (("traffic", "echo", "--run", "{run}"), (SEEN, "\\u000a00:00:00.000 C1 a line")),
        (
            ("traffic", "echo", "--run", "{run}", "--format", "json"),
            ("\\u001b]0;pwned\\u0007", "\\u009b2J", "\\u202e"),
        ),
        (("sniff", "--run", "{run}"), (SEEN,)),
        (("sniff", "--run", "{run}", "--format", "json"), ("\\u001b]0;pwned\\u0007",)),
        (("conversation", "--run-dir", "{run}"), ("c\\u001b]0;pwned",)),
        (("conversation", "--run-dir", "{run}", f"c{EVIL}"), ("c\\u001b]0;pwned",)),
        (("traffic", "judge", "{run}"), ("\\x1b]0;pwned",)),
        (("status", "--run-dir", "{run}"), ("co\\u001b]0;pwned", "run\\u001b]0;pwned")),
        (("status", "--run-dir", "{run}", "--format", "json"), ("co\\u001b]0;pwned",)),
        (("agents", "--run-dir", "{run}"), ("co\\u001b]0;pwned",)),
        (("runs", "{run}"), ()),
        (("record", "info", "{run}"), ()),
        (("design", "show", "{design}"), ("\\u001b]0;pwned\\u0007",)),
        (("design", "check", "{design}"), ()),
        (("nonsense" + EVIL,), ("nonsense\\x1b]0;pwned",)),
    ],
    ids=lambda words: " ".join(words)[:24].encode("unicode_escape").decode(),
)
def test_no_verb_lets_a_control_sequence_through(
    run: Path, words: tuple[str, ...], has: tuple[str, ...]
) -> None:
    """It is shown as JSON writes it, and what is JSON stays that."""
    design = run / "design.toml"
    text = (Path(__file__).parents[2] / "examples/depot/depot/design.toml").read_text()
    design.write_text(text.replace('"carry things', '"\\u001b]0;pwned\\u0007\\u202etxet things'))
    done = CliRunner().invoke(app, [word.format(run=run, design=design) for word in words])
    said = done.stdout + done.stderr
    assert obeyed(said) == [], ascii(said[:2000])
    whole = said + said.replace("\n", "")
    assert [part for part in has if part not in whole] == [], ascii(said)[:3000]
    if "json" in words:
        assert all(json.loads(line) for line in done.stdout.splitlines())


@given(st.text())
def test_a_line_of_json_means_the_same(text: str) -> None:
    """Control characters are escaped as JSON escapes them; a text without any is as it was."""
    line = msgspec.json.encode({"text": text}).decode()
    assert json.loads(escaped(line)) == {"text": text}
    assert obeyed(escaped(line).replace("\t", "")) == []
    assert escaped(escaped(text)) == escaped(text)
    assert "\n" not in one_line(text)


def test_colours_are_ours() -> None:
    """On a terminal they are there, in a table, too; those of others, and their links, are text."""
    out = io.StringIO()
    colours = {"force_terminal": True, "color_system": "standard"}
    console = Console(file=out, width=200, highlight=False, **colours)
    table = Table("name")
    table.add_row(f"\x1b[31mred{TITLE}[link=file:///x]here[/]")
    console.print(table)
    console.print(Text(f"mine{TITLE}", "bold red"))
    console.print(f"[bold]{TITLE}[/]", style="green")
    said = out.getvalue()
    assert "\x1b[1;31mmine\x1b[0m\\u001b\x1b[1;31m]0;pwned\x1b[0m" in said
    assert "\\u001b[31mred" in said
    assert "\x1b]" not in said
    assert "[link=file:///x]here[/]" in said


def test_a_verb_cannot_forget_it(capsys: pytest.CaptureFixture[str]) -> None:
    """Whatever it prints with; a console of rich's own would be seen at once: its colours are
    escaped.
    """

    def verb() -> None:
        """Print."""
        print(TITLE)
        sys.stderr.write(TITLE)
        Console(stderr=True).print(TITLE)
        assert not hasattr(sys.stdout, "buffer")

    lazy.made("verb", verb)([], standalone_mode=False)
    out, err = capsys.readouterr()
    assert out == "\\u001b]0;pwned\\u0007\n"
    assert err.count("\\u001b]0;pwned") == 2


def test_a_shell_is_not_given_such_names(run: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A run folder whose name a terminal would obey is not offered."""
    monkeypatch.chdir(run.parent)
    (run.parent / "runs").mkdir()
    (run.parent / "runs" / f"x{TITLE}").mkdir()
    (run.parent / "runs" / "fine").mkdir()
    assert completion.runs("") == ["runs/fine"]
    assert completion.run_names("") == ["fine"]
