"""What scripts/compose writes into the compose files is what stands there."""

import runpy
from pathlib import Path

import pytest

SCRIPT = runpy.run_path(str(Path(__file__).resolve().parents[2] / "scripts/compose"))


@pytest.mark.parametrize("file", SCRIPT["FILES"])
def test_what_follows_from_the_services_is_as_the_script_writes_it(file: str) -> None:
    """After a change of an agent's service in deploy/compose.yaml: scripts/compose."""
    assert (SCRIPT["DEPLOY"] / file).read_text(encoding="utf-8") == SCRIPT["made"](file)
