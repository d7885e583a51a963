"""`roco design export`: the uses of a design's protocols as models for other tools, spin and Petri net tools.

They are the models that `roco design verify` explores as its second layer, made of the same tables.
"""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Annotated

import msgspec
import typer

from operate.cli import completion
from operate.cli.design import files
from operate.cli.output import Form, Format
from topdown.model.design import Design, load
from topdown.model.errors import NoSuchEntry
from topdown.prove.net import Net
from topdown.prove.net_model import NetModel
from topdown.prove.pairs import net_of
from topdown.prove.pnml import pnml
from topdown.prove.promela import promela

Promela = Annotated[
    Path | None, typer.Option("--promela", help="Write Promela for spin here: a file for one use, a folder for more.")
]
Pnml = Annotated[
    Path | None,
    typer.Option("--pnml", help="Write a place/transition net here, durable uses over ideal queues; as --promela."),
]
Use = Annotated[
    list[str] | None,
    typer.Option("--use", help="A use of a protocol by name; may be given again.", autocompletion=completion.uses),
]
Pair = Annotated[
    str | None,
    typer.Option("--pair", help="Two agents with - between: all uses between them.", autocompletion=completion.pairs),
]
Faults = Annotated[int, typer.Option(min=0, help="How many faults at most.")]
Ideal = Annotated[bool, typer.Option("--ideal", help="Durable uses over ideal queues, without copies and receipts.")]


class Written(msgspec.Struct, frozen=True):
    """A file, and the size of what is in it; `look_with`: the command by which its tool takes it."""

    use: str
    file: str
    variables: int
    queues: int
    commands: int
    look_with: str


def export(
    file: files.File = None,
    promela: Promela = None,
    pnml: Pnml = None,
    use: Use = None,
    pair: Pair = None,
    faults: Faults = 0,
    ideal: Ideal = False,
    form: Form = Format.TEXT,
) -> None:
    """Write the models of a design's protocols for spin (Promela) or for Petri net tools (PNML).

    Examples:
      roco design export --promela plan.pml --use execute_plan
      roco design export --pnml nets --pair AGENT-PEER
    """
    with files.problems(form):
        place = files.meant(file)
        if promela is None and pnml is None:
            raise ValueError("nothing to write; name a file or a folder with --promela or --pnml")
        design = load(place)
        names = _uses(design, use or [], pair)
        written = [*_promela(design, names, promela, faults, ideal), *_pnml(design, names, pnml, faults)]
    if form is Format.JSON:
        files.tell_json(written)
        return
    for one in written:
        things = f"{one.variables} variables, {one.queues} queues" if one.queues else f"{one.variables} variables"
        print(f"wrote {one.file}: {one.use}, {things}, {one.commands} commands")
    for command in dict.fromkeys(one.look_with for one in written):
        print(f"  {command}")


def _uses(design: Design, named: list[str], pair: str | None) -> list[str]:
    """The uses that are meant; all where none is named. Raises NoSuchEntry, ValueError."""
    names = [design.protocol(name).name for name in named]
    if pair is not None:
        ends = set(pair.split("-"))
        if len(ends) != 2:
            raise ValueError(f"--pair {pair!r} is no pair; write two agents with - between")
        found = [use.name for use in design.file.protocol if {use.initiator, use.participant} == ends]
        if not found:
            pairs = (f"{use.initiator}-{use.participant}" for use in design.file.protocol)
            raise NoSuchEntry("pair with a protocol", pair, pairs)
        names += found
    known = [use.name for use in design.file.protocol if use.follows in design.tables]
    return list(dict.fromkeys(names)) or known


def _promela(design: Design, names: list[str], path: Path | None, faults: int, ideal: bool) -> Iterator[Written]:
    look = "spin -a -o1 -o2 FILE && gcc -O2 -DSAFETY -DNOREDUCE -o pan pan.c && ./pan -m1000000"
    for name, where in _places(names, path, ".pml"):
        yield _write(net_of(design, name, faults, ideal=ideal), promela, where, look)


def _pnml(design: Design, names: list[str], path: Path | None, faults: int) -> Iterator[Written]:
    for name, where in _places(names, path, ".pnml"):
        yield _write(net_of(design, name, faults, ideal=True), pnml, where, "open FILE with a Petri net tool")


def _places(names: list[str], path: Path | None, suffix: str) -> list[tuple[str, Path]]:
    """Return the file of each use: the path itself if there is one use and the path has a suffix."""
    if path is None:
        return []
    if len(names) == 1 and path.suffix and not path.is_dir():
        return [(names[0], path)]
    return [(name, path / f"{name}{suffix}") for name in names]


def _write(net: Net, text: Callable[[Net], str], where: Path, look_with: str) -> Written:
    NetModel(net)  # names are checked before anything is written
    words = text(net)
    where.parent.mkdir(parents=True, exist_ok=True)
    where.write_text(words, encoding="utf-8")
    sizes = len(net.variables), len(net.queues), len(net.commands)
    return Written(net.name, str(where), *sizes, look_with.replace("FILE", str(where)))
