"""Blocks of the documentation that show what commands print: found, run, compared, rewritten.

A block is a comment and a fence. Each line that begins with `$ ` is a command, what follows is what
it printed:

    <!-- output: static like=times exit=1 -->
    ```
    $ roco design check broken.toml
    ...
    ```

Words of the comment: `static` (a recorded run is runs/latest) or `fleet=ORDER` (one fleet for all
pages, blocks in this order); then `like=A,B` (see ALIKE), `has=REGEX` (compare this instead of the
words), `fields=N` (compare the first N words of each line), `exit=N` (of the last command),
`first=N`, `last=N`, `only=REGEX` (lines to show), `columns=N` (terminal, else 100),
`setup=COMMANDS` (not shown).
"""

import os
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterator
from difflib import unified_diff
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[1]
PAGES = (ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md")))
RECORDED = {"runs/2026-11-21_18-36-20": ROOT / "tests/histories/pour_seed_7"}
LATEST = "2026-11-21_18-36-20"
TIMEOUT_S = 300.0
HOME = "/home/you/robot"  # what the folder of the commands is called in the pages

_BLOCK = re.compile(
    r"^<!-- output: (?P<words>.*?) -->\n```\w*\n(?P<body>.*?)^```$", re.MULTILINE | re.DOTALL
)
_RUN_NAME = re.compile(r"\b\d{4}-\d\d-\d\d_\d\d-\d\d-\d\d\b")

# What may differ from run to run, by the names that stand behind `like=`.
ALIKE = {
    "times": re.compile(
        r"\b\d{4}-\d\d-\d\d\b|[+-]?\b\d[\d,]*(\.\d+)?"
        r" ?(ns|us|µs|ms|s|min|h)\b|\b\d+:\d\d(:\d\d)?(\.\d+)?\b"
    ),
    "sizes": re.compile(r"\b\d[\d,]*(\.\d+)? ?([kMG]?i?B|[kM]?bit)(/s)?(?!\w)"),
    "paths": re.compile(r"(?<![\w.])~?/[\w./@+-]+"),
    "pids": re.compile(r"\bpid \d+|\b\d{2,7}\b"),
    "numbers": re.compile(r"[+-]?\b\d[\d,]*(\.\d+)?(e[+-]?\d+)?"),
}
OPTIONS = {"like", "has", "fields", "exit", "first", "last", "only", "columns", "setup"}
CHECKOUT = (
    "README.md",
    "shared",
    "velma",
    "examples",
    "tests",
    "deploy",
    "benchmarks",
    "scripts",
    "docs",
)
UNORDERED, UNWRAPPED = "lines", "wraps"
"""Behind `like=`: lines in any order, equal ones once; words only, wherever lines end (a path may
be long).
"""


class Shown(NamedTuple):
    """A command and what the page says it prints."""

    command: str
    text: str


class Block(NamedTuple):
    """A marked block of a page. `order`: None for a static one."""

    page: Path
    line: int
    options: dict[str, str]
    order: int | None
    shown: tuple[Shown, ...]

    @property
    def where(self) -> str:
        """Page and line, as an editor takes it."""
        page = self.page.relative_to(ROOT) if self.page.is_relative_to(ROOT) else self.page
        return f"{page}:{self.line}"


_QUOTED = re.compile(r"^````.*?^````$", re.MULTILINE | re.DOTALL)
"""A page's text that another page quotes."""


class Difference(NamedTuple):
    """A difference between a page and the output; `words` for people."""

    block: Block
    words: str


def blocks(page: Path) -> Iterator[Block]:
    """The marked blocks of a page. ValueError names a comment or a body that cannot be read."""
    text = _QUOTED.sub(
        lambda quoted: "\n" * quoted[0].count("\n"), page.read_text(encoding="utf-8")
    )
    for match in _BLOCK.finditer(text):
        line = text.count("\n", 0, match.start()) + 1
        kind, *rest = shlex.split(match["words"])
        name, _, order = kind.partition("=")
        options = dict(word.partition("=")[::2] for word in rest)
        like = set(filter(None, options.get("like", "").split(",")))
        strange = (options.keys() - OPTIONS) | (like - {*ALIKE, UNORDERED, UNWRAPPED})
        if name not in ("static", "fleet") or strange:
            what = sorted(strange) or kind
            raise ValueError(f"{page}:{line}: {what}; see scripts/shown.py for the words")
        shown = tuple(_split(match["body"], page, line))
        yield Block(page, line, options, int(order) if name == "fleet" else None, shown)


def _split(body: str, page: Path, line: int) -> Iterator[Shown]:
    if not body.startswith("$ "):
        raise ValueError(f"{page}:{line}: a shown output begins with `$ ` and its command")
    for part in re.split(r"^\$ ", body, flags=re.MULTILINE)[1:]:
        command, _, text = part.partition("\n")
        while command.endswith("\\"):
            more, _, text = text.partition("\n")
            command += "\n" + more
        yield Shown(command, text.rstrip("\n"))


def place(folder: Path, recorded: bool) -> None:
    """Make a folder look like a checkout in which somebody works; `recorded`: with a run in it."""
    for name in CHECKOUT:
        (folder / name).symlink_to(ROOT / name)
    if recorded:
        for name, source in RECORDED.items():
            shutil.copytree(source, folder / name)
        (folder / "runs/latest").symlink_to(LATEST)


def run(block: Block, folder: Path) -> tuple[list[str], str]:
    """Return the output of each command of a block, cut as the block says, and the fault of its
    exit code, or "".
    """
    if setup := block.options.get("setup"):
        done = bash(setup, folder)
        if done.returncode:
            return [], f"setup ended with {done.returncode}: {done.stdout}"
    texts = []
    for shown in block.shown:
        done = bash(shown.command, folder, block.options.get("columns", "100"))
        texts.append(cut(_clean(done.stdout, folder), block.options))
        wanted = int(block.options.get("exit", "0")) if shown is block.shown[-1] else 0
        if done.returncode != wanted:
            ended = f"`{shown.command}` ended with {done.returncode}, expected {wanted}"
            return texts, f"{ended}:\n{done.stdout}"
    return texts, ""


def bash(command: str, folder: Path, columns: str = "100") -> subprocess.CompletedProcess[str]:
    """Run a command in a folder as the pages' reader would: venv first in PATH, no colours, a
    terminal so wide.
    """
    ours = ("ROCO_", "PYTHON", "COLUMNS")
    kept = {name: value for name, value in os.environ.items() if not name.startswith(ours)}
    own = {
        "PATH": f"{ROOT / '.venv/bin'}:{Path(sys.executable).parent}:{os.environ['PATH']}",
        "COLUMNS": columns,
        "NO_COLOR": "1",
        "TERM": "dumb",
        "TZ": "UTC",
        "LC_ALL": "C.UTF-8",
        # none beside the sources that a page shows
        "PYTHONPYCACHEPREFIX": str(ROOT / ".venv/bytecode"),
        # a fleet in containers on this machine is none of the pages'
        "DOCKER_HOST": "unix:///nowhere",
    }
    words = ["bash", "-c", command]
    return subprocess.run(
        words, cwd=folder, env=kept | own, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True, timeout=TIMEOUT_S, check=False,
    )  # fmt: skip


def _clean(text: str, folder: Path) -> str:
    for name in (str(folder), str(folder.resolve()), str(ROOT)):
        text = text.replace(name, HOME)
    text = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", text).replace("\r\n", "\n")
    return "\n".join(line.rstrip() for line in text.split("\n")).strip("\n")


def in_order(every: list[Block]) -> list[Block]:
    """The blocks that need a fleet, by their number, else as the pages have them."""
    return sorted(
        (block for block in every if block.order is not None), key=lambda block: block.order or 0
    )


def cut(text: str, options: dict[str, str]) -> str:
    """The lines that a block shows; `...` stands for the others."""
    lines = text.split("\n")
    if only := options.get("only"):
        lines = [line for line in lines if re.search(only, line)]
    if (first := int(options.get("first", "0"))) and len(lines) > first:
        lines = [*lines[:first], "..."]
    if (last := int(options.get("last", "0"))) and len(lines) > last:
        lines = ["...", *lines[-last:]]
    return "\n".join(lines)


def normal(text: str, like: str, fields: int | None = None) -> str:
    """A text without what may differ; where anything may, widths of columns and of lines may
    too. `fields`: only so many words of each line count.
    """
    text = _RUN_NAME.sub("RUN", text)
    if fields is not None:
        text = "\n".join(" ".join(line.split()[:fields]) for line in text.split("\n"))
    names = list(filter(None, like.split(",")))
    for name in names:
        if name in ALIKE:
            text = ALIKE[name].sub(name.upper(), text)
    if UNWRAPPED in names:
        return " ".join(text.split())
    lines = [line.rstrip() for line in text.split("\n")]
    if names:
        lines = [
            re.sub(r"([─━═╌-])\1+", r"\1", re.sub(r"\s+", " ", line)).strip() for line in lines
        ]
    return "\n".join(sorted(set(lines)) if UNORDERED in names else lines).strip("\n")


def differences(block: Block, texts: list[str], wrong: str) -> list[Difference]:
    """Return the differences between the page and the output."""
    found = [Difference(block, f"{block.where}: {wrong}")] if wrong else []
    like, has = block.options.get("like", ""), block.options.get("has")
    fields = int(block.options["fields"]) if "fields" in block.options else None
    for shown, printed in zip(block.shown, texts, strict=False):
        if has:
            same = all(re.search(has, text, re.MULTILINE) for text in (shown.text, printed))
        else:
            same = normal(shown.text, like, fields) == normal(printed, like, fields)
        if not same:
            both = (shown.text.split("\n"), printed.split("\n"))
            lines = "\n".join(unified_diff(*both, "the page", "now", lineterm="", n=1))
            found.append(Difference(block, f"{block.where}: `{shown.command}`\n{lines}"))
    return found


def written(block: Block, texts: list[str]) -> None:
    """Put what was printed into the page."""
    text = block.page.read_text(encoding="utf-8")
    body = "".join(
        f"$ {shown.command}\n" + (f"{new}\n" if new else "")
        for shown, new in zip(block.shown, texts, strict=True)
    )
    for match in _BLOCK.finditer(text):
        if tuple(_split(match["body"], block.page, block.line)) == block.shown:
            block.page.write_text(
                text[: match.start("body")] + body + text[match.end("body") :], encoding="utf-8"
            )
            return
