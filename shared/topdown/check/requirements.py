"""The requirement tree is a tree, and every requirement is handled by exactly one step (paper, section 4, step 2)."""

from collections.abc import Iterator, Mapping

from topdown.check.trace import evidence, known, said
from topdown.model.design import Design
from topdown.model.findings import Finding, Kind


def findings(design: Design) -> Iterator[Finding]:
    """Parents that are missing, cycles, requirements that no step or that two handle, unknown ones."""
    parents = {entry.id: entry.parent for entry in design.file.requirement}
    listed = f"one of {', '.join(parents)}"
    for index, (name, parent) in enumerate(parents.items()):
        where, at = f"requirement {name}", ("requirement", index)
        if parent and parent not in parents:
            yield Finding(Kind.UNDEFINED, where, f"its parent {parent!r} is not there", listed, (*at, "parent"))
        elif _circular(name, parents):
            yield Finding(Kind.NO_TREE, where, "is its own ancestor", "requirements form a tree", (*at, "parent"))
    handled: dict[str, int] = {}
    for index, step in enumerate(design.file.step):
        for name in step.requirements:
            where, place = f"step {index + 1}", ("step", index, "requirements")
            if name not in parents:
                yield Finding(Kind.UNDEFINED, where, f"requirement {name!r} is not there", listed, place)
            elif name in handled:
                wrong = f"requirement {name} is handled by step {handled[name]} already"
                yield Finding(Kind.COVERED_TWICE, where, wrong, "each requirement in one step", place)
            handled.setdefault(name, index + 1)
    for index, name in enumerate(parents):
        if name not in handled:
            right = "the method stops when all are processed: name it in a step"
            yield Finding(Kind.NOT_COVERED, f"requirement {name}", "no step handles it", right, ("requirement", index))
    yield from _evidence(design)


def _evidence(design: Design) -> Iterator[Finding]:
    """Evidence can be read, and the communicates it names are the design's."""
    for index, entry in enumerate(design.file.requirement):
        for word in entry.evidence:
            where, at = f"requirement {entry.id}", ("requirement", index, "evidence")
            try:
                one = evidence(word)
                strange = one.kind == "message" and not known(design, said(one.name))
            except ValueError as error:
                right = "write event:NAME, test:PATH::NAME or message:USE act LANGUAGE.Class"
                yield Finding(Kind.NO_EVIDENCE, where, str(error).partition(";")[0], right, at)
                continue
            if strange:
                right = "name a protocol, an act and a class that a message lists"
                yield Finding(Kind.NO_EVIDENCE, where, f"no message of the design is {one.name!r}", right, at)


def _circular(name: str, parents: Mapping[str, str]) -> bool:
    """Whether a requirement is among its own ancestors."""
    seen, here = {name}, parents.get(name, "")
    while here and here not in seen:
        seen.add(here)
        here = parents.get(here, "")
    return here == name
