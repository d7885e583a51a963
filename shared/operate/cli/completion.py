"""Names for the shell to complete: runs, agents, processes, channels. Imports are made only when a shell asks."""

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from topdown.model.design import Design

RUNS = Path("runs")


def runs(incomplete: str) -> list[str]:
    """The folders of runs, newest first."""
    found = sorted((path for path in RUNS.glob("*") if path.is_dir()), key=lambda path: path.name, reverse=True)
    return [str(path) for path in found if str(path).startswith(incomplete)]


def run_names(incomplete: str) -> list[str]:
    """Return the names of runs in runs/, newest first."""
    return [Path(path).name for path in runs("") if Path(path).name.startswith(incomplete)]


def ages(incomplete: str) -> list[str]:
    """Return durations as one may write them."""
    return [text for text in ("12h", "1d", "7d", "4w") if text.startswith(incomplete)]


def agents(incomplete: str) -> list[str]:
    """The agents of the design."""
    return _begun(incomplete, (design.agents for design in _designs()))


def channels(incomplete: str) -> list[str]:
    """The channels of the design."""
    return _begun(incomplete, (design.channels for design in _designs()))


def protocols(incomplete: str) -> list[str]:
    """The protocols of the design, as it names what it follows."""
    return _begun(incomplete, (design.tables for design in _designs()))


def ontologies(incomplete: str) -> list[str]:
    """Return the ontologies of the design."""
    return _begun(incomplete, ({use.ontology: None for use in one.file.protocol if use.ontology} for one in _designs()))


def languages(incomplete: str) -> list[str]:
    """Return the content languages of the design."""
    return _begun(incomplete, ([one.name for one in design.file.language] for design in _designs()))


def performatives(incomplete: str) -> list[str]:
    """All performatives of FIPA."""
    from fipa_codec.performatives import Performative

    return [name for name in Performative if name.startswith(incomplete)]


def targets(incomplete: str) -> list[str]:
    """What --target takes: the words, the compose projects that run, the folders of runs."""
    from operate.cli.fleet.compose import projects

    return [name for name in ("local", "compose", *projects()) if name.startswith(incomplete)] + runs(incomplete)


def _designs() -> "Iterable[Design]":
    """The design of the system here; none where there is no system, or its design cannot be read."""
    from operate.system import NoSystemError, here
    from topdown.model.errors import TopdownError

    try:
        return (here().design,)
    except (NoSystemError, TopdownError):
        return ()


def _begun(incomplete: str, found: Iterable[Iterable[str]]) -> list[str]:
    return [name for names in found for name in names if name.startswith(incomplete)]
