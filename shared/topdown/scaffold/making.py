"""Makes a project's files of a design, all or nothing: names are looked at before anything is written."""

from pathlib import Path

from topdown.model import loading
from topdown.model.design import Design
from topdown.scaffold.agents import agent_files
from topdown.scaffold.languages import language_files
from topdown.scaffold.naming import ScaffoldError, require_names
from topdown.scaffold.project import project_files as once
from topdown.scaffold.tests import check_files
from topdown.scaffold.writing import Outcome, write

KEY = "roco/{system}/{channel}/{sender}/{receiver}/{protocol}/{performative}"
"""The key template that agent_runtime.core.wiring puts communicates on; a design that runs on it has this one."""
_SMALLEST = Path(__file__).with_name("smallest.toml")


def smallest(name: str) -> str:
    """The text of the smallest design that runs: two agents, one channel, one protocol."""
    return _SMALLEST.read_text(encoding="utf-8").replace("NAME", name)


def project_files(design_text: str, package: str, file: str = "design.toml") -> dict[str, str]:
    """Path -> text of every file of the project. Raises DesignError, ScaffoldError."""
    design = Design(loading.read(design_text, file), file)
    require_names(design, package)
    if design.file.system.key != KEY:
        raise ScaffoldError(f"{file}: system.key", f"is {design.file.system.key!r}", f"the runtime's keys are {KEY!r}")
    if slips := design.decomposition.slips:
        raise ScaffoldError(f"{file}: step {slips[0].step}", slips[0].wrong, slips[0].right)
    files = once(design, design_text, package) | language_files(design, package) | check_files(design, package)
    for agent in design.agents:
        files |= agent_files(design, package, agent)
    return files


def scaffold(design_text: str, folder: Path, package: str = "", file: str = "design.toml") -> Outcome:
    """Write the project into `folder`; `package` "": the system's name. Raises DesignError, ScaffoldError, OSError."""
    package = package or loading.read(design_text, file).system.name
    files = project_files(design_text, package, file)
    target = folder / package / "design.toml"
    outcome = write(folder, files)
    if any(kept.path == f"{package}/design.toml" for kept in outcome.kept):
        raise ScaffoldError(
            str(target), f"was changed and differs from {file}", f"make the project of it: --from {target}"
        )
    return outcome
