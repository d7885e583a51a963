"""A documentation page as its reader walks it: files are written, commands are run, outputs
compared.

Blocks of the page, by the words behind their fence: `sh run` (commands, run together in one shell
that goes on where the last one was), `text output` (what the commands before it print), `<kind>
file=PATH`, `<kind> append=PATH`.
"""

import os
import re
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

_BLOCK = re.compile(r"^```(?P<words>[^\n]*)\n(?P<body>.*?)^```$", re.MULTILINE | re.DOTALL)
_NORMAL = (
    (re.compile(r"^ *\d+\.\d\d s  ", re.MULTILINE), "TIME  "),
    (re.compile(r"\bin \d+\.\d+s\b"), "in TIME"),
    (re.compile(r" +\d+\.\d s  (?=holds)"), "  TIME  "),
    # of a model that may become finer; that it holds is compared
    (re.compile(r" +[\d,]+ states"), " N states"),
    (re.compile(r"^\d+ steps,", re.MULTILINE), "N steps,"),
    (re.compile(r"files in \S*runs/\S+"), "files in RUN"),
    # stands where it happens among what is said
    (re.compile(r"^TIME  all ready\n", re.MULTILINE), ""),
)


class Block(NamedTuple):
    """A fenced block: its words, its text, the line of the page it begins at."""

    words: tuple[str, ...]
    body: str
    line: int


def blocks(page: Path) -> Iterator[Block]:
    """The blocks of a page that mean something to a walker."""
    text = page.read_text(encoding="utf-8")
    for match in _BLOCK.finditer(text):
        yield Block(
            tuple(match["words"].split()), match["body"], text.count("\n", 0, match.start()) + 1
        )


def normal(text: str) -> str:
    """A printed text without what differs from run to run: times, folders, counts, where `all
    ready` stands.
    """
    for pattern, word in _NORMAL:
        text = pattern.sub(word, text)
    return text.rstrip()


class Walk:
    """Walks in `folder`, with `paths` before PATH; `shown`: pairs of (line, what the page shows,
    what was printed).
    """

    def __init__(self, folder: Path, *paths: Path) -> None:
        self.here = folder
        self.shown: list[tuple[int, str, str]] = []
        self._printed = ""
        path = os.pathsep.join((*map(str, paths), os.environ["PATH"]))
        kept = {
            name: value
            for name, value in os.environ.items()
            if not name.startswith(("ROCO_", "PYTHON"))
        }
        self._environment = kept | {"PATH": path, "COLUMNS": "80", "PYTHONDONTWRITEBYTECODE": "1"}

    def walk(self, page: Path) -> None:
        """From the first block to the last. AssertionError names the command that failed, with what
        it said.
        """
        for block in blocks(page):
            kind, _, path = block.words[-1].partition("=") if block.words else ("", "", "")
            if kind == "run":
                self._run(block)
            elif kind == "output":
                self.shown.append((block.line, block.body, self._printed))
            elif kind in ("file", "append"):
                with (self.here / path).open(
                    "a" if kind == "append" else "w", encoding="utf-8"
                ) as file:
                    file.write(block.body)

    def _run(self, block: Block) -> None:
        """In one shell; the next one begins in the folder where this one ended."""
        script = f"set -e\n{block.body}\npwd >&3"
        read, write = os.pipe()
        with os.fdopen(read) as where:
            done = subprocess.run(
                ["bash", "-c", f"exec 3>&{write}\n{script}"],
                cwd=self.here,
                env=self._environment,
                pass_fds=(write,),
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                text=True,
                timeout=120,
            )
            os.close(write)
            ended = where.read().strip()
        assert done.returncode == 0, f"line {block.line}: {block.body}\n{done.stdout}"
        self.here, self._printed = Path(ended), done.stdout
