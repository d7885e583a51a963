"""scripts/sbom lists what an image's lock has, no more and no less, with licences and their
texts.
"""

import json
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from cyclonedx.model.bom import Bom

pytestmark = [pytest.mark.process, pytest.mark.timeout(60)]
ROOT = Path(__file__).resolve().parents[2]
SCRIPT = ROOT / "scripts/sbom"
OTHER_VERSION = """
import sys
from importlib.machinery import SourceFileLoader
sbom = SourceFileLoader("sbom", sys.argv[1]).load_module()
sbom.installed(sbom.Locked("msgspec", "0.0.1", ()))
"""


def made(out: Path, image: str) -> tuple[dict[str, Any], str]:
    """The bill of an image and its notices."""
    command = [sys.executable, str(SCRIPT), "--out", str(out), image]
    done = subprocess.run(command, capture_output=True, text=True, timeout=50, check=False)
    assert done.returncode == 0, done.stderr
    return json.loads((out / f"{image}.cdx.json").read_text()), (
        out / f"{image}.notices.txt"
    ).read_text()


@pytest.mark.parametrize("image", ["planner", "recorder"])
def test_the_bill_is_the_lock(tmp_path: Path, image: str) -> None:
    """Each package with version, hashes, licence and address; CycloneDX's own reader takes it."""
    told, texts = made(tmp_path, image)
    assert (told["bomFormat"], told["specVersion"]) == ("CycloneDX", "1.6")
    lock = (ROOT / f"requirements/{image}.txt").read_text()
    names = {one["name"]: one for one in told["components"]}
    assert set(names) <= set(re.findall(r"^([a-z0-9-]+)==", lock, re.MULTILINE))
    assert {"msgspec", "numpy", "cryptography"} <= set(names)
    assert not {"matplotlib", "pytest"} & set(names)
    for name, one in names.items():
        assert one["purl"] == f"pkg:pypi/{name}@{one['version']}"
        assert f"{name}=={one['version']}" in lock
        hashes = {each["content"] for each in one["externalReferences"][0]["hashes"]}
        assert hashes
        assert all(f"sha256:{each}" in lock for each in hashes)
        assert f"{one['version']}\nLicence: " in texts
    assert "licenses" in names["numpy"]
    assert "Redistribution and use in source and binary forms" in texts
    assert len(Bom.from_json(data=told).components) == len(names)


def test_it_says_who_needs_whom(tmp_path: Path) -> None:
    """Without the extras that a package names."""
    told, _ = made(tmp_path, "planner")
    needs = {one["ref"].partition("@")[0]: one.get("dependsOn", []) for one in told["dependencies"]}
    assert [each.partition("@")[0] for each in needs["pkg:pypi/gtpyhop"]] == [
        "pkg:pypi/gtpyhop-core",
        "pkg:pypi/gtpyhop-examples",
    ]


def test_another_version_than_the_locked_one_is_refused() -> None:
    """Its licence might be another one, too."""
    command = [sys.executable, "-c", OTHER_VERSION, str(SCRIPT)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=50, check=False)
    assert done.returncode != 0
    assert "the lock 0.0.1; scripts/demo --help installs it" in done.stderr


@pytest.mark.parametrize(
    "image", ["agent", "knowledge", "planner", "executor", "monitor", "recorder"]
)
def test_an_image_says_what_it_is(image: str) -> None:
    """By the labels of OCI, with the project's own version and licence."""
    stage = (ROOT / "deploy/Dockerfile").read_text().split(f" AS {image}\n")[1].split("\nFROM ")[0]
    labels = dict(re.findall(r'org\.opencontainers\.image\.(\w+)="([^"]*)"', stage))
    project = (ROOT / "pyproject.toml").read_text()
    assert f'version = "{labels["version"]}"' in project
    assert f'license = "{labels["licenses"]}"' in project
    assert labels["title"] == f"robot-companion/{image}"
    assert (labels["source"], labels["revision"]) == ("$SOURCE", "$REVISION")
