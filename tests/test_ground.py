"""The ground holds: rooms have their rows, locks have hashes and no addresses, scripts say what
they need.
"""

import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PYPROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())
CONTRACTS = [row for row in PYPROJECT["tool"]["importlinter"]["contracts"] if row["type"] == "room"]
LOCKS = sorted((ROOT / "requirements").glob("*.txt"))
SCRIPTS = [
    path
    for path in [*(ROOT / "scripts").iterdir(), ROOT / ".ci" / "run"]
    if path.is_file() and path.suffix in ("", ".sh")
]


def pinned(lock: Path) -> dict[str, str]:
    """Versions of a lock by package name; who needs a package decides where it is, and is left
    out.
    """
    return dict(
        re.findall(r"^([a-z0-9-]+)(==[^ ;]+)[^\\]*? \\$", lock.read_text(), flags=re.MULTILINE)
    )


def test_every_room_has_a_row_that_says_what_it_may_import() -> None:
    """A new service or package cannot be forgotten by the import contracts."""
    rows = {contract["room"] for contract in CONTRACTS}
    rooms = {f"services.{path.parent.name}" for path in (ROOT / "services").glob("*/__init__.py")}
    rooms |= {path.parent.name for path in (ROOT / "shared").glob("*/__init__.py")}
    rooms |= {f"velma.{path.parent.name}" for path in (ROOT / "velma").glob("*/__init__.py")}
    assert rooms <= rows


def test_no_service_may_import_another() -> None:
    """Services meet over communicates only."""
    for contract in CONTRACTS:
        assert not [name for name in contract["may_import"] if name.startswith("services")], (
            contract["room"]
        )


def linted(folder: Path, package: str, room: str, *also: str) -> subprocess.CompletedProcess[str]:
    """Check the package in a folder against one row, in which msgspec may be imported, and
    `also`.
    """
    may_import = "".join(f"\n    {one}" for one in ("msgspec", *also))
    (folder / ".importlinter").write_text(
        f"[importlinter]\nroot_packages =\n    {package}\ninclude_external_packages ="
        " true\ncontract_types =\n    room: scripts.rooms.Room\n[importlinter:contract:row]\nname"
        f" = row\ntype = room\nroom = {room}\nmay_import ={may_import}\n"
    )
    (folder / "scripts").symlink_to(ROOT / "scripts")
    lint = Path(sys.executable).with_name("lint-imports")
    words = [lint, "--no-logo", "--no-cache"]
    return subprocess.run(words, cwd=folder, capture_output=True, text=True, timeout=50)


def made(folder: Path, package: str, **modules: str) -> None:
    """Write a package with these modules."""
    inside = folder.joinpath(*package.split("."))
    inside.mkdir(parents=True)
    for name, text in modules.items():
        (inside / f"{name}.py").write_text(text)
    for above in [inside, *inside.parents]:
        if above == folder:
            break
        (above / "__init__.py").touch()


@pytest.mark.parametrize("room", ["fipa_codec", "services.task"])
def test_a_forbidden_import_is_found_and_named(room: str, tmp_path: Path) -> None:
    """The contract sees an import its row does not allow, in a package of that very name."""
    made(tmp_path, room, core="import json\nimport zenoh\n")
    found = linted(tmp_path, room.partition(".")[0], room)
    assert found.returncode == 1, found.stdout + found.stderr
    assert f"{room}.core:2: import zenoh" in found.stdout
    assert "import json" not in found.stdout


def test_rooms_that_share_a_row_do_not_import_each_other(tmp_path: Path) -> None:
    """A part of a task imports what the row lists, and other parts of its own task alone."""
    plan = "import msgspec\nimport tasks.take.done\n"
    made(tmp_path, "tasks.take", plan=plan, done="import zenoh\n")
    made(tmp_path, "tasks.pour", plan="from tasks.take import plan\nimport tasks.take.done\n")
    found = linted(tmp_path, "tasks", "tasks.*.plan", "tasks.*.done")
    assert found.returncode == 1, found.stdout + found.stderr
    assert re.findall(r"^tasks.*", found.stdout, re.MULTILINE) == [
        "tasks.pour.plan:2: import tasks.take.done",
        "tasks.pour.plan:1: from tasks.take import plan",
        "tasks.*.plan may import: msgspec, tasks.*.done",
    ]


def test_a_row_of_a_room_that_is_not_there_is_refused(tmp_path: Path) -> None:
    """It would allow everything."""
    made(tmp_path, "tasks.take", plan="import zenoh\n")
    found = linted(tmp_path, "tasks", "tasks.*.plans")
    assert found.returncode == 1
    assert "there is no room tasks.*.plans" in found.stdout + found.stderr


def test_a_sum_of_floats_is_found_and_named(tmp_path: Path) -> None:
    """By types, however it is written; sums of integers are taken, also where a float is wanted."""
    wrong = [
        "sum(floats)", "sum((1.0, 2))", "sum(part / 2 for part in whole)", "sum(whole, 0.5)",
        "sum(map(float, whole))",
    ]  # fmt: skip
    right = [
        "sum(whole)", "sum(one > 0.5 for one in floats)", "sum(map(len, words))",
        "math.fsum(floats)",
    ]  # fmt: skip
    lines = [f"found{number}: float = {value}" for number, value in enumerate(wrong + right)]
    given = ["import math", "floats: list[float]", "whole: list[int]", "words: list[str]"]
    (tmp_path / "sums.py").write_text("\n".join(given + lines))
    mypy = [sys.executable, "-m", "mypy", "--no-error-summary", "--config-file", "pyproject.toml"]
    command = [*mypy, "--cache-dir", str(tmp_path), str(tmp_path / "sums.py")]
    found = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=50)
    named = re.findall(r"sums.py:(\d+): error: sum\(\) of floats .* write math.fsum", found.stdout)
    first = len(given) + 1
    assert [int(line) for line in named] == [*range(first, first + len(wrong))], (
        found.stdout + found.stderr
    )


@pytest.mark.parametrize("lock", LOCKS, ids=lambda lock: lock.name)
def test_a_lock_has_a_hash_for_each_package_and_no_address(lock: Path) -> None:
    """The installed packages are those locked, from whatever index the machine uses. Every Python
    gets the same version: types, and last digits of results, differ from one numpy to the next. The
    images run what the tests ran; libgomp.txt is not part of that, it only lends a library, nor is
    ros2.txt, which is for an environment of its own.
    """
    text = lock.read_text()
    assert "://" not in text
    for block in re.split(r"\n(?=[a-z0-9])", text.partition("\n")[2]):
        assert "--hash=sha256:" in block, block
    names = re.findall(r"^([a-z0-9-]+)==", text, flags=re.MULTILINE)
    assert len(names) == len(set(names))
    if lock.stem not in ("libgomp", "ros2"):
        assert pinned(lock).items() <= pinned(ROOT / "requirements" / "all.txt").items()


def test_the_lock_covers_what_pyproject_asks_for() -> None:
    """No dependency was added without scripts/lock."""
    project = PYPROJECT["project"]
    asked = sum(project["optional-dependencies"].values(), project["dependencies"])
    names = {re.split(r"[<>=!~\[; ]", one)[0].lower() for one in asked} - {project["name"]}
    assert names <= pinned(ROOT / "requirements" / "all.txt").keys()


FOR_OTHERS = {"a2a", "foxglove", "mcp", "ros"}


def test_each_extra_has_its_lock() -> None:
    """One lock per image; all.txt has dev too."""
    extras = dict(PYPROJECT["project"]["optional-dependencies"])
    del extras["dev"]
    assert extras.keys() <= {lock.stem for lock in LOCKS}
    # `robot-companion[all]` runs the whole fleet; what opens it to tools of others is asked for
    (everything,) = extras.pop("all")
    named = set(re.split(r"[\[\],]", everything))
    assert named == {PYPROJECT["project"]["name"], "", *extras} - FOR_OTHERS
    # it would name registry hosts
    assert not (ROOT / "uv.lock").exists()


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda script: script.name)
def test_a_script_is_sound_and_can_be_called(script: Path) -> None:
    """A script parses in the language its first line names, and is executable unless it is there to
    be sourced.
    """
    if "python" in script.read_text().partition("\n")[0]:
        compile(script.read_text(), script, "exec")
    else:
        subprocess.run(["bash", "-n", script], check=True, timeout=10)
    assert script.suffix == ".sh" or script.stat().st_mode & 0o111
