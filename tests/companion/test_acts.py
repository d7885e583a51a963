"""The acts: their rows, the union that is made of them, and the design that lists them."""

import ast
import re
import subprocess
import sys
from pathlib import Path
from typing import get_args

import msgspec
import pytest

from companion import tasks
from companion.acts import ACTS, GENERAL, SHOWN, AnyAct, needed
from companion.autonomy import Level, asks
from companion.design import DESIGN, RC
from companion.languages import cmd, hfsm, rc
from companion.languages.evidence import Claim, Otherwise

pytestmark = pytest.mark.timeout(60)
ANSWERS = (rc.Accepted, rc.Done, rc.NotDone)
HOME = rc.Home("p/1", "left")
AS_SENT = bytes.fromhex("83a474797065a4486f6d65a36b6579a3702f31a473696465a46c656674")
"""As every version has sent it."""


def test_an_act_is_general_or_of_one_task():
    """No act has two rows, and each class of a task is in its part `done`."""
    of_tasks = [row.act for part in tasks.parts("done") for row in getattr(part, "ACTS", ())]
    assert len(ACTS) == len(GENERAL) + len(of_tasks)
    with_acts = {part.__name__ for part in tasks.parts("done") if hasattr(part, "ACTS")}
    assert {act.__module__ for act in of_tasks} == with_acts


def test_the_language_has_all_acts():
    """And a plan takes each of them."""
    assert set(get_args(AnyAct)) == set(ACTS)
    assert set(RC.classes) == {*ACTS, *ANSWERS}
    state = msgspec.msgpack.encode(hfsm.ActState("home", HOME))
    assert msgspec.msgpack.decode(state, type=hfsm.ActState).command == HOME


def test_the_design_lists_the_acts():
    """In the interface of ex, each by its name and with one answer."""
    entries = next(one.entries for one in DESIGN.file.interface if one.name == "acts")
    words = {act.__name__[0].lower() + act.__name__[1:] for act in ACTS}
    assert {entry.name for entry in entries} == words
    arguments = {name for entry in entries for name in entry.arguments}
    assert arguments == {f"RC.{act.__name__}" for act in ACTS}
    assert all(entry.answers == ("RC.Done",) for entry in entries)


def test_an_act_is_sent_as_before():
    """By the name of its class alone, wherever that is defined."""
    assert msgspec.msgpack.encode(HOME) == AS_SENT
    assert {msgspec.inspect.type_info(act).tag for act in ACTS} == {act.__name__ for act in ACTS}


def test_each_act_is_shown():
    """Each field that its row names is one of the command."""
    assert set(SHOWN) == set(ACTS)
    for act, row in SHOWN.items():
        fields = dict.fromkeys(act.__struct_fields__, "word")
        assert "{" not in row.event.format_map(fields)
        assert not row.points_on or {row.points_on, "approach"} <= set(fields)


def test_what_an_act_needs_is_about_things():
    """That the joints are there is the loop's word."""
    for act, row in ACTS.items():
        failing = {check.claim for check in row.checks if check.otherwise is Otherwise.FAILED}
        assert needed(act) == failing - {Claim.THERE}
    assert needed(rc.Grasp) == {Claim.HELD}


def test_an_operator_is_asked_for_more_at_each_level():
    """Before no act, before those that handle a thing, before each."""
    asked = {level: {act for act in ACTS if asks(level, act)} for level in Level}
    assert asked[Level.AUTO] == set()
    assert {rc.Grasp, rc.Release} < asked[Level.HANDLING] < asked[Level.CONFIRM] == set(ACTS)


NEEDLESS = """
import sys
for name in ("numpy", "velma", "pinocchio", "mujoco", "matplotlib", "operate"):
    sys.modules[name] = None
import companion.acts, companion.design, companion.autonomy
import companion.sentences, companion.telemetry
from companion.tasks import parts
assert parts("done")
companion.sentences.catalogue(companion.sentences.Reader.POLISH)
"""


def test_agents_without_numpy_know_the_acts():
    """Their words, too: co, ta and hi have neither numpy nor the robot, and no tools."""
    subprocess.run([sys.executable, "-c", NEEDLESS], check=True, timeout=50)


# --- Nothing outside the rooms of the tasks names a task, its command, or its act: who adds one
# changes its folder


ROOT = Path(tasks.__file__).parents[3]
ROOM = Path(tasks.__file__).parent
PRODUCT = ("services", "shared/companion", "shared/operate", "velma", "deploy", "scripts")
for part in ("command", "done"):
    tasks.parts(part)
COMMANDS = {one.__name__ for one in cmd.Command.__subclasses__()}
OF_TASKS = {one.__name__ for one in rc.Command.__subclasses__()} - {
    row.act.__name__ for row in GENERAL
}
CLASSES = COMMANDS | OF_TASKS
WORDS = re.compile(rf"\b({'|'.join(sorted(CLASSES))})\b")
ALLOWED = {
    "services/human_interface/interpretation.py": (
        "what a thing is good for: some uses of the catalogue are called as the task is"
    ),
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
