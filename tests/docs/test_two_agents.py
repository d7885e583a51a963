"""The programs of docs/two-agents.md run as they stand there, and say what the page says."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

PAGE = (Path(__file__).parents[2] / "docs" / "two-agents.md").read_text(encoding="utf-8")
BLOCKS = dict(re.findall(r"```python file=(\S+)\n(.*?)```", PAGE, re.DOTALL))
CALLS = (
    ("bidder.py", "ann", "12"),
    ("bidder.py", "bob", "9"),
    ("bidder.py", "eve"),
    ("manager.py",),
)


@pytest.mark.zenoh
@pytest.mark.timeout(60)
def test_a_contract_net_with_a_silent_bidder(tmp_path: Path) -> None:
    """The cheaper one does it, the silent one counts as refused, and everybody ends."""
    for name, text in BLOCKS.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    begun = [
        subprocess.Popen(
            [sys.executable, *words],
            cwd=tmp_path,
            text=True,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
        )
        for words in CALLS
    ]
    try:
        said = [process.communicate(timeout=40)[0] for process in begun]
    finally:
        for process in begun:
            process.kill()
            process.wait()
    assert [process.returncode for process in begun] == [0] * len(CALLS), said
    shown = PAGE.partition("```text\n")[2].partition("```")[0].splitlines()[1:]
    assert sorted(line for text in said for line in text.splitlines()) == sorted(shown)


def test_each_program_is_short() -> None:
    """Thirty lines, as the title says, but for what a program opens with."""
    for name, text in BLOCKS.items():
        code = [
            line
            for line in text.splitlines()
            if line and not line.startswith(('"""', "import ", "from "))
        ]
        assert len(code) <= 30, (name, len(code))
