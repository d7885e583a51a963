"""Nothing outside the rooms of the tasks names a task, its command, or its act: who adds one
changes its folder.
"""

import ast
import re
from pathlib import Path

import pytest

from companion import tasks
from companion.acts import GENERAL
from companion.languages import cmd, rc

pytestmark = pytest.mark.timeout(60)
ROOT = Path(tasks.__file__).parents[3]
ROOM = Path(tasks.__file__).parent
PRODUCT = ("services", "shared/companion", "shared/operate", "velma", "deploy", "scripts")
for part in ("command", "done"):
    tasks.parts(part)
COMMANDS = {one.__name__ for one in cmd.Command.__subclasses__()}
ACTS = {one.__name__ for one in rc.Command.__subclasses__()} - {row.act.__name__ for row in GENERAL}
CLASSES = COMMANDS | ACTS
WORDS = re.compile(rf"\b({'|'.join(sorted(CLASSES))})\b")
ALLOWED = {
    "shared/companion/design.toml": (
        "the design lists each content with its size and rate; test_acts.py compares it"
    ),
    "shared/companion/planning/grasping.py": (
        "a word of the seed: with another one, every plan would change"
    ),
    "shared/companion/tools/verbs/pour_run.py": "`roco experiment pour` is the paper's main job",
}


def _python(path):
    """Yield what a program names: classes, the rooms of tasks, and tasks by their names alone."""
    for node in ast.walk(ast.parse(path.read_text())):
        match node:
            case (
                ast.Name(id=name)
                | ast.Attribute(attr=name)
                | ast.alias(name=name)
                | ast.ClassDef(name=name)
            ) if name in CLASSES:
                yield f"{node.lineno}: {name}"
            case ast.Constant(value=str(name)) if name in tasks.NAMES:
                yield f"{node.lineno}: {name!r}"
            case ast.Attribute(attr=name) if name.isupper() and name.lower() in tasks.NAMES:
                yield f"{node.lineno}: {name}"
            case ast.ImportFrom(module=str(module)) if module.startswith(f"{tasks.__name__}."):
                yield f"{node.lineno}: {module}"


def _others(path):
    """Yield the classes that a file of data, words or a page's script names."""
    for number, line in enumerate(path.read_text().splitlines(), start=1):
        yield from (f"{number}: {name}" for name in WORDS.findall(line))


def _named():
    for folder in PRODUCT:
        for path in sorted((ROOT / folder).rglob("*")):
            if path.is_relative_to(ROOM) or "__pycache__" in path.parts:
                continue
            name = path.relative_to(ROOT).as_posix()
            if path.suffix == ".py":
                yield from ((name, one) for one in _python(path))
            elif path.suffix in (".toml", ".js", ".html", ".j2", ".ttl", ".json", ".yaml"):
                yield from ((name, one) for one in _others(path))


def test_no_task_is_named_outside_its_room():
    """But for what stands in ALLOWED, with its reason."""
    named = list(_named())
    assert not [f"{name}:{one}" for name, one in named if name not in ALLOWED]
    assert set(ALLOWED) == {name for name, _ in named}
