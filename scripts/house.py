"""The picture of docs/architecture.md: which room imports which, read off the code.

    scripts/house.py           print it
    scripts/house.py --write   put it into the page

A room of the picture is a package; services are two rooms, agents and the others. An arrow that
follows from others is left out.
"""

import sys
import tomllib
from pathlib import Path

import grimp
from marked import put

from companion.design import DESIGN
from companion.tools.system import PROCESSES

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "architecture.md"
OPEN, CLOSE = "<!-- house: made by scripts/figures -->\n", "<!-- :house -->\n"
AGENTS = {
    process.module.partition(".")[2] for process in PROCESSES if process.name in DESIGN.agents
}
"""Folders of services that are agents of the design."""
KINDS = {"any": "any design", "this": "this system", "process": "processes"}
ROOMS = {
    "agents": "process",
    "monitor, supervisor, router, page": "process",
    "companion": "this",
    "velma": "this",
    "console": "any",
    "operate": "any",
    "agent_runtime": "any",
    "topdown": "any",
    "fipa_codec": "any",
    "c_library": "any",
}
"""Room -> what it is for; in the order of the picture."""


def room_of(module: str) -> str:
    """The room of the picture that a module belongs to."""
    first, _, rest = module.partition(".")
    if first == "services":
        agent = rest.partition(".")[0] in AGENTS
        return "agents" if agent else "monitor, supervisor, router, page"
    return first


def edges() -> set[tuple[str, str]]:
    """Return the direct imports between rooms as pairs (importer, imported)."""
    roots = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"][
        "root_packages"
    ]
    graph = grimp.build_graph(*roots, cache_dir=None)
    modules = graph.modules - {"services"}
    pairs = (
        (module, other)
        for module in modules
        for other in graph.find_modules_directly_imported_by(module)
    )
    return {
        (room_of(one), room_of(other)) for one, other in pairs if room_of(one) != room_of(other)
    }


def drawn(pairs: set[tuple[str, str]]) -> set[tuple[str, str]]:
    """The pairs without those that follow from others. The rooms must not have a circle."""
    above = {one: {other for first, other in pairs if first == one} for one, _ in pairs}

    def reached(room: str) -> set[str]:
        return above.get(room, set()).union(*map(reached, above.get(room, set())))

    return {
        (one, other)
        for one, other in pairs
        if not any(other in reached(between) for between in above[one])
    }


def picture() -> str:
    """The rooms as a mermaid graph; an arrow goes from the room that imports to the one that is
    imported.
    """
    ids = {room: f"r{number}" for number, room in enumerate(ROOMS)}
    lines = ["```mermaid", "graph TD"]
    for kind, title in KINDS.items():
        lines.append(f'  subgraph {kind}["{title}"]')
        lines += [f'    {ids[room]}["{room}"]' for room, of in ROOMS.items() if of == kind]
        lines.append("  end")
    lines += sorted(f"  {ids[one]} --> {ids[other]}" for one, other in drawn(edges()))
    return "\n".join([*lines, "```", ""])


def page(text: str) -> str:
    """The page with the picture as it is now. Raise ValueError where the page has no place for
    it.
    """
    return put(text, OPEN, CLOSE, picture())


if __name__ == "__main__":
    if sys.argv[1:] == ["--write"]:
        PAGE.write_text(page(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
    else:
        print(picture(), end="")
