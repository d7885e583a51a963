"""Every service is started by `python -m services.<x>`, and its options have names in the
environment.

No process of ours takes a file of the folder that it is started in for a library.
"""

import ast
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import pytest

pytestmark = pytest.mark.process

ROOT = Path(__file__).parents[1]
MODULES = [
    "operate.router",
    *(
        ".".join(path.relative_to(above).parent.parts)
        for above, room in (
            (ROOT, "services"),
            (ROOT / "shared", "operate"),
            (ROOT / "shared", "console"),
        )
        for path in sorted((above / room).rglob("__main__.py"))
    ),
]
SHARED = {"CONNECT", "LISTEN", "SYSTEM", "RUN_DIR", "LOG_LEVEL", "SPEED", "SEED", "SCENE"}
OWN = {
    "console": set(),
    "operate.pictures": set(),
    "services.executor.loop": {"SLOTS", "SCENE", "SEED", "SPEED", "BACKEND"},
    "services.supervisor": SHARED - {"LISTEN"},
    "operate.supervisor": SHARED - {"LISTEN"},
}


PLAIN = {name: value for name, value in os.environ.items() if not name.startswith("ROCO_")}


def run(module: str, *arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
    """The service's process, to its end."""
    command = [sys.executable, "-m", module, *arguments]
    env = PLAIN | {"COLUMNS": "200", "NO_COLOR": "1"} | environment
    return subprocess.run(command, env=env, capture_output=True, text=True, timeout=50.0)


def test_all_are_here() -> None:
    """Six agents, the loop; router, monitor, supervisor twice; pictures, wires, roco, page."""
    assert len(MODULES) == 6 + 1 + 2 * 3 + 4


@pytest.mark.parametrize("module", MODULES)
def test_help(module: str) -> None:
    """`--help` says what it is and which variable stands for which option; nothing is opened or
    written.
    """
    done = run(module, "--help")
    assert done.returncode == 0, done.stderr
    assert not done.stderr
    assert "Usage: python -m" in done.stdout
    for name in OWN.get(module, SHARED):
        assert f"ROCO_{name}]" in done.stdout, name


def test_a_wrong_value_in_the_environment_is_named(tmp_path: Path) -> None:
    """It ends with 2, which no supervisor tries again, and says which option was wrong."""
    places = {"ROCO_RUN_DIR": str(tmp_path / "run"), "ROCO_SLOTS": str(tmp_path / "slots")}
    for module, name, value in (
        ("services.task", "SEED", "seven"),
        ("services.router", "LOG_LEVEL", "loud"),
        ("services.executor.loop", "SPEED", "2"),
        ("services.supervisor", "SPEED", "2"),
        ("services.supervisor", "LOG_LEVEL", "loud"),
    ):
        done = run(module, **places, **{f"ROCO_{name}": value})
        assert done.returncode == 2, (module, name)
        assert f"--{name.lower().replace('_', '-')}" in done.stderr, module
        assert not (tmp_path / "run").exists(), module


PLACES = ("shared", "services", "velma", "scripts", "benchmarks", "deploy", "examples")
OWN_FOLDER = {
    "examples/depot/tests/test_run.py": (
        "a project's own test starts it as its README says, where its package is"
    ),
}
"""Files that may start Python so that it looks in the folder it is started in, and why."""
PYTHON = re.compile(r"(.*/)?python3?")
CALLED = re.compile(r"""(?:python3?|\$python|\$1|\$candidate)"? +(?:-m|-c|-)(?=\s)""")
"""In a shell's words: a Python with a module or code right behind it."""
SAFE_IMAGE = "PYTHONSAFEPATH=1"
"""In an image's environment: all that is run in it is safe."""


def programs() -> Iterator[tuple[str, str]]:
    """Yield path and text of each file that may start a process."""
    for place in PLACES:
        for path in sorted((ROOT / place).rglob("*")):
            code = path.is_file() and path.suffix in (".py", ".sh", "")
            if code and b"\0" not in path.read_bytes():
                yield str(path.relative_to(ROOT)), path.read_text()


def is_python(word: ast.expr) -> bool:
    """Whether a word of a command is the interpreter."""
    if isinstance(word, ast.Constant):
        return isinstance(word.value, str) and PYTHON.fullmatch(word.value) is not None
    named = ("sys.executable", "str(ROOT / '.venv/bin/python')", "str(OWN)", "str(VENV)")
    return ast.unparse(word) in named


def unsafe_words(text: str) -> Iterator[str]:
    """Yield the commands in Python's code whose interpreter has neither -P nor a script right
    behind it.
    """
    for node in ast.walk(ast.parse(text)):
        words = node.args if isinstance(node, ast.Call) else getattr(node, "elts", [])
        for word, after in pairwise(words):
            is_option = isinstance(after, ast.Constant) and str(after.value).startswith("-")
            is_script = not is_option and not isinstance(after, ast.Starred)
            safe = is_script or ast.unparse(after) in ("'-P'", "*sys.argv")
            if is_python(word) and not safe:
                yield ast.unparse(node)


def unsafe(path: str, text: str) -> list[str]:
    """Return the commands in a program that start Python so that it looks in the folder here
    first.
    """
    if path.endswith(".py") or "python" in text.partition("\n")[0]:
        return list(unsafe_words(text))
    lines = [line for line in text.splitlines() if not line.lstrip().startswith("#")]
    return [line.strip() for line in lines if CALLED.search(line) and SAFE_IMAGE not in text]


def test_no_program_looks_in_the_folder_that_it_is_started_in() -> None:
    """`touch random.py` there must not keep a fleet from coming up, and the file must not run."""
    found = {path: commands for path, text in programs() if (commands := unsafe(path, text))}
    assert {path: commands for path, commands in found.items() if path not in OWN_FOLDER} == {}
    assert found.keys() == OWN_FOLDER.keys()


@pytest.mark.parametrize(
    ("path", "text"),
    [
        ("a.py", "run([sys.executable, '-m', 'x'])"),
        ("a.py", "(sys.executable, '-c', code)"),
        ("a.py", "run([sys.executable, *words])"),
        ("a.py", "os.execvp('python3', ['python3', '-m', 'x'])"),
        ("a.py", "docker('exec', name, 'python', '-m', 'x')"),
        ("a", "#!/bin/sh\nif python -m x; then"),
        ("a", '#!/bin/sh\n"$python" -c x'),
        ("a", "#!/bin/sh\n.venv/bin/python - <<PYTHON"),
    ],
)
def test_such_a_program_is_found(path: str, text: str) -> None:
    """The test above can fail, and does not where -P stands there."""
    assert len(unsafe(path, text)) == 1
    for option in ("'-m'", "'-c'", "*words", " -m", " -c", " -"):
        first = "'-P', " + option if option[0] != " " else "-P " + option.strip()
        safe = option.replace(option.strip(), first)
        if option in text:
            assert unsafe(path, text.replace(option, safe, 1)) == []
            break


TAKEN = (
    "numpy", "msgspec", "zenoh", "typer", "rich", "mcap", "rerun", "mujoco", "jinja2", "uvicorn",
    "velma", "services",
)  # fmt: skip
"""Names beside the standard library's that a file in the folder here may have."""
MARKS = """
import sys
with open({mark!r}, "a") as mark:
    mark.write(f"{{__name__}} in {{sys.argv}}\\n")
raise ImportError("a file of the folder here")
"""


@pytest.mark.zenoh
@pytest.mark.timeout(200)
def test_a_file_of_the_folder_here_is_no_library(tmp_path: Path) -> None:
    """A fleet with everything in it comes up, is asked and is ended beside random.py, json.py and
    all others.
    """
    mark, run = tmp_path / "it-ran", tmp_path / "run"
    for name in (*sys.stdlib_module_names, *TAKEN):
        (tmp_path / f"{name}.py").write_text(MARKS.format(mark=str(mark)))
    said = {}
    for words in (
        "up --out", "doctor --run-dir", "traffic judge", "why --run", "down --run-dir", "report",
    ):  # fmt: skip
        command = [sys.executable, "-P", "-m", "console", *words.split(), str(run)]
        done = subprocess.run(
            command, cwd=tmp_path, env=PLAIN, capture_output=True, text=True, timeout=150
        )
        said[words.split()[0]] = (done.returncode, done.stdout + done.stderr)
    assert not mark.exists(), mark.read_text()
    assert said["up"][0] == 0, said["up"][1]
    assert "a file of the folder here" not in str(said)
    # nothing was done, so it is no success
    assert (said["down"][0], said["report"][0]) == (0, 1), said
