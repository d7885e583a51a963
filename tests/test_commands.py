"""Every service is started by `python -m services.<x>`, and its options have names in the environment."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.process

ROOT = Path(__file__).parents[1]
MODULES = sorted(
    ".".join(path.relative_to(above).parent.parts)
    for above, room in ((ROOT, "services"), (ROOT / "shared", "operate"))
    for path in (above / room).rglob("__main__.py")
)
SHARED = {"CONNECT", "LISTEN", "SYSTEM", "RUN_DIR", "LOG_LEVEL", "SPEED", "SEED", "SCENE"}
OWN = {
    "operate.cli": set(),
    "services.executor.conformance": set(),
    "operate.pictures": set(),
    "services.executor.loop": {"SLOTS", "SCENE", "SEED", "SPEED", "BACKEND"},
    "services.supervisor": SHARED - {"LISTEN"},
    "operate.supervisor": SHARED - {"LISTEN"},
}


def run(module: str, *arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
    """The service's process, to its end."""
    plain = {name: value for name, value in os.environ.items() if not name.startswith("ROCO_")}
    return subprocess.run(
        [sys.executable, "-m", module, *arguments],
        env=plain | {"COLUMNS": "200", "NO_COLOR": "1"} | environment,
        capture_output=True,
        text=True,
        timeout=50.0,
        check=False,
    )


def test_all_are_here() -> None:
    """Six agents, the loop, the kit for back-ends; router, monitor, supervisor twice; pictures, wires, roco, page."""
    assert len(MODULES) == 6 + 1 + 1 + 2 * 3 + 4


@pytest.mark.parametrize("module", MODULES)
def test_help(module: str) -> None:
    """`--help` says what it is and which variable stands for which option; nothing is opened or written."""
    done = run(module, "--help")
    assert done.returncode == 0, done.stderr
    assert not done.stderr
    assert "Usage: python -m" in done.stdout
    for name in OWN.get(module, SHARED):
        assert f"ROCO_{name}]" in done.stdout, name


@pytest.mark.parametrize(
    ("module", "name", "value"),
    [
        ("services.task", "SEED", "seven"),
        ("services.router", "LOG_LEVEL", "loud"),
        ("services.executor.loop", "SPEED", "2"),
        ("services.supervisor", "SPEED", "2"),
        ("services.supervisor", "LOG_LEVEL", "loud"),
    ],
)
def test_a_wrong_value_in_the_environment_is_named(module: str, name: str, value: str, tmp_path: Path) -> None:
    """It ends with 2, which no supervisor tries again, and says which option was wrong."""
    places = {"ROCO_RUN_DIR": str(tmp_path / "run"), "ROCO_SLOTS": str(tmp_path / "slots")}
    done = run(module, **places, **{f"ROCO_{name}": value})
    assert done.returncode == 2
    assert f"--{name.lower().replace('_', '-')}" in done.stderr
    assert not (tmp_path / "run").exists()
