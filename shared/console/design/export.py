"""`roco design export`: the uses of a design's protocols as models for spin (Promela).

They are the models that `roco design verify` explores as its second layer, made of the same tables.
"""

from pathlib import Path
from typing import Annotated

import msgspec

from console import completion
from console.design import files
from console.output import Form, Format, option
from topdown.model.design import Design, load
from topdown.model.errors import NoSuchEntry
from topdown.prove.net import NetModel, promela
from topdown.prove.pairs import net_of

PROMELA = option("Write Promela for spin here: a file for one use, a folder for more.", "--promela")
USE = option("A use of a protocol by name; may be given again.", "--use", complete=completion.uses)
PAIR = option("Two agents with - between: all uses between them.", complete=completion.pairs)
IDEAL = option("Durable uses over ideal queues, without copies and receipts.", "--ideal")


LOOK_WITH = "spin -a -o1 -o2 FILE && gcc -O2 -DSAFETY -DNOREDUCE -o pan pan.c && ./pan -m1000000"


class Written(msgspec.Struct, frozen=True):
    """A file, and the size of what is in it; `look_with`: the command by which its tool takes
    it.
    """

    use: str
    file: str
    variables: int
    queues: int
    commands: int
    look_with: str


def export(
    file: files.File = None,
    to: Annotated[Path | None, PROMELA] = None,
    use: Annotated[list[str] | None, USE] = None,
    pair: Annotated[str | None, PAIR] = None,
    faults: Annotated[int, option("How many faults at most.", min=0)] = 0,
    ideal: Annotated[bool, IDEAL] = False,
    form: Form = Format.TEXT,
) -> None:
    """Write the models of a design's protocols for spin (Promela).

    Examples:
      roco design export --promela plan.pml --use execute_plan
      roco design export --promela models --pair AGENT-PEER
    """
    with files.problems(form):
        place = files.meant(file)
        if to is None:
            raise ValueError("nothing to write; name a file or a folder with --promela")
        design = load(place)
        names = _uses(design, use or [], pair)
        one_file = len(names) == 1 and bool(to.suffix) and not to.is_dir()
        written = []
        for name in names:
            net = net_of(design, name, faults, ideal=ideal)
            NetModel(net)  # names are checked before anything is written
            where = to if one_file else to / f"{name}.pml"
            where.parent.mkdir(parents=True, exist_ok=True)
            where.write_text(promela(net), encoding="utf-8")
            sizes = len(net.variables), len(net.queues), len(net.commands)
            look_with = LOOK_WITH.replace("FILE", str(where))
            written.append(Written(net.name, str(where), *sizes, look_with))
    lines = [
        f"wrote {one.file}: {one.use}, {one.variables} variables,"
        f"{f' {one.queues} queues,' if one.queues else ''} {one.commands} commands"
        for one in written
    ]
    lines += dict.fromkeys(f"  {one.look_with}" for one in written)
    files.tell(written, form, "\n".join(lines))


def _uses(design: Design, named: list[str], pair: str | None) -> list[str]:
    """The uses that are meant; all where none is named. Raises NoSuchEntry, ValueError."""
    names = [design.protocol(name).name for name in named]
    if pair is not None:
        ends = set(pair.split("-"))
        if len(ends) != 2:
            raise ValueError(f"--pair {pair!r} is no pair; write two agents with - between")
        found = [
            use.name for use in design.file.protocol if {use.initiator, use.participant} == ends
        ]
        if not found:
            pairs = (f"{use.initiator}-{use.participant}" for use in design.file.protocol)
            raise NoSuchEntry("pair with a protocol", pair, pairs)
        names += found
    known = [use.name for use in design.file.protocol if use.follows in design.tables]
    return list(dict.fromkeys(names)) or known
