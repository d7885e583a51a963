"""Built packages can be installed and used without the clone: the codec alone, and the whole
product.
"""

import ctypes
import os
import re
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
CODEC = ROOT / "shared" / "fipa_codec"
UV = Path(sys.executable).with_name("uv")


def has_gomp() -> bool:
    """Whether the machine has GNU's OpenMP, which pinocchio's wheel is linked against."""
    try:
        ctypes.CDLL("libgomp.so.1")
    except OSError:
        return False
    return True


class Place:
    """An empty environment outside of the clone, and a folder to work in."""

    def __init__(self, folder: Path) -> None:
        self.work, self.bin = folder / "work", folder / "env" / "bin"
        self.work.mkdir()
        ours = ("PYTHON", "ROCO_", "VIRTUAL_")
        kept = {name: text for name, text in os.environ.items() if not name.startswith(ours)}
        path = os.pathsep.join((str(self.bin), "/usr/local/bin", "/usr/bin", "/bin"))
        self.variables = kept | {"PATH": path, "COLUMNS": "100", "ROCO_VIEW": "off"}
        self.run(UV, "venv", "--quiet", "--python", sys.executable, self.bin.parent)

    def install(self, project: Path, extras: str = "") -> None:
        """Build a project's wheel and install it with its dependencies, in the versions that are
        locked.
        """
        wheels = self.bin.parents[1] / "wheels"
        build = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", wheels]
        self.run(*build, cwd=project)
        (wheel,) = wheels.glob("*.whl")
        name = wheel.name.partition("-")[0]
        locked = ["--constraint", ROOT / "requirements" / "all.txt"]
        python = ["--python", self.bin / "python"]
        what = f"{name}{extras} @ {wheel.as_uri()}"
        self.run(UV, "pip", "install", "--quiet", *python, *locked, what)

    def run(
        self,
        *command: str | Path,
        cwd: Path | None = None,
        safe: bool = True,
        timeout: float = 120.0,
    ) -> str:
        """Return the output of a command. `safe`: Python does not look for modules in the folder it
        is started in.
        """
        env, words = self.variables | ({"PYTHONSAFEPATH": "1"} if safe else {}), map(str, command)
        done = subprocess.run(
            [*words], cwd=cwd or self.work, env=env, capture_output=True, text=True, timeout=timeout
        )
        assert done.returncode == 0, f"{command}: {done.returncode}\n{done.stdout}\n{done.stderr}"
        return done.stdout

    def outside_of_the_clone(self, package: str) -> None:
        """No path that Python searches is in the clone, nor is the package."""
        code = f"import sys, {package} as p; print(p.__file__, *sys.path)"
        searched = self.run(self.bin / "python", "-c", code).split()
        assert not [path for path in searched if Path(path).is_relative_to(ROOT)]


@pytest.mark.timeout(120)
def test_the_codec_alone(tmp_path: Path) -> None:
    """With msgspec only: the page's request is asked and answered, its ACL text is printed and
    read.
    """
    place = Place(tmp_path)
    place.install(CODEC)
    listed = place.run(UV, "pip", "list", "--python", place.bin / "python", "--format", "freeze")
    assert {line.partition("==")[0] for line in listed.split()} == {"fipa-codec", "msgspec"}
    place.outside_of_the_clone("fipa_codec")
    page = (ROOT / "docs" / "acl.md").read_text(encoding="utf-8")
    section = page.partition("## The codec alone")[2]
    code, shown = re.findall(r"```(?:python|text)\n(.*?)```", section, re.DOTALL)
    (place.work / "request.py").write_text(code, encoding="utf-8")
    assert place.run(place.bin / "python", "request.py") == shown
    assert list(place.bin.parent.glob("lib/python3*/site-packages/fipa_codec/py.typed"))


def test_both_distributions_say_the_same_of_the_codec() -> None:
    """Version, oldest Python, licence, and no dependency that its row of imports does not have."""
    both = [tomllib.loads((folder / "pyproject.toml").read_text()) for folder in (ROOT, CODEC)]
    whole, codec = (one["project"] for one in both)
    for key in ("version", "license"):
        assert codec[key] == whole[key]
    assert codec["requires-python"] == whole["requires-python"].partition(",")[0]
    assert (CODEC / "LICENSE").read_text() == (ROOT / "LICENSE").read_text()
    rows = both[0]["tool"]["importlinter"]["contracts"]
    (row,) = (row for row in rows if row.get("room") == "fipa_codec")
    needed = [re.split("[<>=]", one)[0] for one in codec["dependencies"]]
    assert needed == row["may_import"]
    assert set(codec["dependencies"]) <= set(whole["dependencies"])


def test_every_file_of_the_packages_is_in_the_wheel(tmp_path: Path) -> None:
    """No pattern of .gitignore, which the build obeys too, leaves out any but the library that each
    machine builds.
    """
    build = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", tmp_path]
    subprocess.run(build, cwd=ROOT, check=True)
    (wheel,) = tmp_path.glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        inside = set(archive.namelist())
    build = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["hatch"]["build"]
    targets = build["targets"]["wheel"]
    left_out = {ROOT / path.strip("/") for path in targets["exclude"]}
    for package in targets["packages"]:
        above = (ROOT / package).parent
        files = {path for path in (ROOT / package).rglob("*") if path.is_file()} - left_out
        ours = [one for one in files if one.suffix != ".so" and "__pycache__" not in one.parts]
        assert {str(path.relative_to(above)) for path in ours} <= inside
    assert not [name for name in inside if "/runs/" in name and name.startswith("robot_companion")]


@pytest.mark.long
@pytest.mark.zenoh
@pytest.mark.timeout(900)
@pytest.mark.skipif(not has_gomp(), reason="needs libgomp.so.1 (Debian: apt install libgomp1)")
def test_the_whole_product(tmp_path: Path) -> None:
    """`robot-companion[all]`: a new project is made and checked, the depot runs, and Velma
    pours.
    """
    place = Place(tmp_path)
    place.install(ROOT, "[all]")
    place.outside_of_the_clone("services")
    roco = place.bin / "roco"
    version = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"]
    assert place.run(roco, "--version") == f"roco {version}\n"
    assert "Run the main job" in place.run(roco, "demo", "--help")

    place.run(roco, "design", "new", "lift")
    assert "no findings" in place.run(roco, "design", "check", "lift/lift/design.toml")
    assert "all ready" in place.run(
        place.bin / "python", "-m", "lift", "--seconds", "5", cwd=place.work / "lift", safe=False
    )

    depot = place.bin.parent / "share" / "robot-companion" / "examples" / "depot"
    assert "no findings" in place.run(roco, "design", "check", "depot/design.toml", cwd=depot)
    said = place.run(place.bin / "python", "-m", "depot", "--seconds", "40", cwd=depot, safe=False)
    assert "Figures(delivered=3, failed=0)" in said

    said = place.run(roco, "demo", "--headless", "--speed", "max", "--seed", "7", timeout=500.0)
    assert "of the content is in the bowl" in said
    assert (place.work / "runs" / "latest" / "report.html").is_file()
