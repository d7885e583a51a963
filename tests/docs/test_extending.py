"""docs/extending.md: each recipe is carried out on a copy of the tree, and what it says of files
and checks is true.
"""

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs/extending.md").read_text(encoding="utf-8")
TITLE = re.compile(r"^## (?P<title>\((?P<letter>\w)\) .*)$", re.MULTILINE)
PART = re.compile(
    r"^(?:In `(?P<file>[^`]+)`[^\n]*:|At the end of `(?P<end>[^`]+)`:"
    r"|New file `(?P<new>[^`]+)`(?:(?P<empty>, empty\.)|[^\n]*:))\n"
    r"|^```console\n(?P<console>.*?)^```$",
    re.MULTILINE | re.DOTALL,
)
FENCED = re.compile(r"\n```(?P<kind>\w+)\n(?P<code>.*?)^```$", re.MULTILINE | re.DOTALL)
COUNTS = re.compile(r"^\| \[\((\w)\) .*\| (\d+) \| (\d+) \|$", re.MULTILINE)
COUNTED = {
    letter: (int(old), int(new)) for letter, old, new in COUNTS.findall(PAGE.partition("## ")[0])
}
"""Letter of a recipe -> the files that it edits, and those that it adds, as the table says."""
TREE = (
    "benchmarks",
    "deploy",
    "docs",
    "examples",
    "requirements",
    "scripts",
    "services",
    "shared",
    "tests",
    "velma",
)
COMMAND_S = 100.0


class Recipe(NamedTuple):
    """A section of the page."""

    letter: str
    text: str

    def parts(self) -> Iterator[tuple[re.Match[str], str]]:
        """Its edits, each with the code below it, and its commands, from top to bottom."""
        for part in PART.finditer(self.text):
            fenced = (
                None if part["console"] or part["empty"] else FENCED.match(self.text, part.end())
            )
            assert part["console"] or part["empty"] or fenced, f"no code below {part[0]!r}"
            assert not fenced or bool(part["file"]) == (fenced["kind"] == "diff"), part[0]
            yield part, fenced["code"] if fenced else ""


def recipes() -> Iterator[Recipe]:
    """The recipes of the page's table."""
    found = list(TITLE.finditer(PAGE))
    for one, after in zip(found, [*found[1:], None], strict=True):
        if one["letter"] in COUNTED:
            yield Recipe(one["letter"], PAGE[one.end() : after.start() if after else None])


RECIPES = {recipe.letter: recipe for recipe in recipes()}


class Copy:
    """A copy of the tree that a recipe changes."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        for name in TREE:
            shutil.copytree(
                ROOT / name,
                folder / name,
                ignore=shutil.ignore_patterns("__pycache__"),
                symlinks=True,
            )
        for file in ROOT.glob("*.*"):
            if file.is_file():
                shutil.copy(file, folder)
        (folder / ".venv").symlink_to(sys.prefix)
        self.edited: set[str] = set()
        self.added: set[str] = set()
        self.console: list[str] = []

    def change(self, part: re.Match[str], code: str) -> None:
        """Do what a part of a recipe says."""
        if part["new"]:
            file = self.folder / part["new"]
            assert not file.exists(), f"{part['new']} is there already"
            file.parent.mkdir(exist_ok=True)
            file.write_text(code, encoding="utf-8")
            self.added.add(part["new"])
            return
        name = part["file"] or part["end"]
        file = self.folder / name
        before = file.read_text(encoding="utf-8")
        file.write_text(before + code if part["end"] else patched(before, code), encoding="utf-8")
        self.edited.add(name)

    def follow(self, recipe: Recipe) -> None:
        """Make all edits of a recipe, and keep its commands."""
        for part, code in recipe.parts():
            if part["console"] is None:
                self.change(part, code)
            else:
                self.console.append(part["console"])

    def run(self, command: str, within_s: float = COMMAND_S) -> str:
        """Output of a command in the copy, which ends with 0."""
        environment = os.environ | {
            "PYTHONPATH": f"{self.folder}:{self.folder / 'shared'}",
            "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}",
            "OMP_NUM_THREADS": "1",
        }
        done = subprocess.run(
            command,
            shell=True,
            cwd=self.folder,
            env=environment,
            capture_output=True,
            text=True,
            timeout=within_s,
            check=False,
        )
        assert done.returncode == 0, f"{command}\n{done.stdout[-5000:]}{done.stderr[-5000:]}"
        return done.stdout + done.stderr

    def checked(self, console: str) -> None:
        """Run the commands of a block; each prints the lines that stand below it."""
        for block in console.removeprefix("$ ").split("\n$ "):
            command, *lines = block.splitlines()
            said = self.run(command)
            assert [line for line in lines if line not in said] == [], (
                f"{command} says\n{said[-5000:]}"
            )


def patched(text: str, diff: str) -> str:
    """The text after a diff; the lines that a hunk keeps or removes stand in the text once."""
    for hunk in diff.split("@@\n"):
        marked = hunk.splitlines(keepends=True)
        old = "".join(line[1:] for line in marked if line[0] in " -")
        new = "".join(line[1:] for line in marked if line[0] in " +")
        assert f"\n{text}".count(f"\n{old}") == 1, f"not there, or several times: {old!r}"
        text = f"\n{text}".replace(f"\n{old}", f"\n{new}")[1:]
    return text


@pytest.fixture(scope="module")
def followed(tmp_path_factory: pytest.TempPathFactory):
    """Return a function that gives a copy in which a recipe was followed."""
    copies: dict[str, Copy] = {}

    def follow(letter: str) -> Copy:
        if letter not in copies:
            copy = copies[letter] = Copy(tmp_path_factory.mktemp("tree"))
            copy.follow(RECIPES[letter])
            assert copy.console, f"recipe {letter} has no check"
        return copies[letter]

    return follow


def test_the_table_counts_the_files_of_every_recipe(followed) -> None:
    """Those that are edited by hand, and those that are new."""
    assert {
        letter: (len(followed(letter).edited), len(followed(letter).added)) for letter in RECIPES
    } == COUNTED


@pytest.mark.timeout(300)
@pytest.mark.process
@pytest.mark.parametrize("letter", RECIPES)
def test_a_recipe_does_what_it_says(followed, letter: str) -> None:
    """Its commands end with 0 and print what stands below them; ruff finds nothing in what is
    pasted.
    """
    copy = followed(letter)
    for console in copy.console:
        copy.checked(console)
    files = " ".join(name for name in (*copy.edited, *copy.added) if name.endswith(".py"))
    copy.run(f"ruff check {files} && ruff format --check {files}")


@pytest.mark.long
@pytest.mark.timeout(600)
def test_all_recipes_together_have_the_types_that_fit(tmp_path: Path) -> None:
    """One after the other in one tree."""
    copy = Copy(tmp_path)
    for recipe in RECIPES.values():
        copy.follow(recipe)
    copy.run("mypy", within_s=500.0)
