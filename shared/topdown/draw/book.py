"""The whole book about a design, or a part of it: which sections there are, and what each is made
from.
"""

import re
from collections.abc import Callable
from enum import StrEnum
from html import escape

import msgspec

from topdown.draw import canvas, decomposition, document, machines, protocols, system
from topdown.draw.document import Figure, Grid, Section
from topdown.model.design import Design

# --- One self-contained HTML page of all sections: no scripts, nothing fetched, light and dark, fit
# for paper


def page(title: str, lead: str, sections: tuple[Section, ...]) -> str:
    """The page; the same sections give the same bytes."""
    body = "".join(_section(section) for section in sections)
    blocks = []  # links to all sections and to the figures in them
    for section in sections:
        figures = [part for part in section.parts if isinstance(part, Figure)]
        found = [(_name(f.name), escape(f.caption.split(":")[0])) for f in figures]
        links = "".join(f'<a href="#{name}">{words}</a>' for name, words in found if found[1:])
        head = f'<a href="#{section.what}"><strong>{escape(section.title)}</strong></a>'
        blocks.append(f"<div>{head}{links}</div>")
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n<meta name="viewport"'
        ' content="width=device-width, initial-scale=1">\n<meta name="color-scheme" content="light'
        f' dark">\n<title>{escape(title)}</title>\n<style>\n{canvas.page_rules()}</style>\n'
        f"</head>\n<body>\n<h1>{escape(title)}</h1>\n<p"
        f' class="lead">{escape(lead)}</p>\n<nav>{"".join(blocks)}</nav>\n{body}<footer>Derived'
        " from the design file; change that, not this page.</footer>\n</body>\n</html>\n"
    )


def _name(name: str) -> str:
    """A name as it may stand in an address."""
    return "figure-" + re.sub("[^A-Za-z0-9_-]", lambda found: f"-{ord(found[0]):x}-", name)


def _section(section: Section) -> str:
    blocks = [_part(part) for part in section.parts]
    if section.paired:
        pairs = zip(*[iter(blocks)] * 2, strict=True)
        blocks = [f'<div class="pair"><div>{a}</div><div>{b}</div></div>\n' for a, b in pairs]
    head = f'<h2 id="{section.what}">{escape(section.title)}</h2>'
    lead = f'<p class="lead">{escape(section.lead)}</p>'
    return f"<section>\n{head}\n{lead}\n{''.join(blocks)}</section>\n"


def _part(part: Grid | Figure) -> str:
    notes = "".join(f'<p class="note">{escape(note)}</p>\n' for note in part.notes)
    if isinstance(part, Figure):
        caption = f"<figcaption>{escape(part.caption)}</figcaption>"
        figure = f"{caption}\n{part.canvas.svg(alone=False)}"
        return f'<figure id="{_name(part.name)}">{figure}</figure>\n{notes}'
    if part.folded or part.detail:
        table = _table(part, titled=False)
        return f"<details><summary>{escape(part.title)}</summary>\n{table}{notes}</details>\n"
    return _table(part, titled=True) + notes


def _table(grid: Grid, titled: bool) -> str:
    caption = f"<caption>{escape(grid.title)}</caption>\n" if titled and grid.title else ""
    head = "".join(f"<th>{escape(cell)}</th>" for cell in grid.head)
    head = f"<thead><tr>{head}</tr></thead>\n" if any(grid.head) else ""
    rows = ""
    for first, *rest in grid.rows:
        cells = "".join(f"<td>{escape(cell)}</td>" for cell in rest)
        rows += f'<tr><th scope="row">{escape(first)}</th>{cells}</tr>\n'
    return f'<div class="wide"><table>\n{caption}{head}<tbody>\n{rows}</tbody></table></div>\n'


# --- The whole book about a design, or a part of it -----------------------------------------------


class What(StrEnum):
    """The sections, in their order; `all`: every one."""

    ALL = "all"
    REQUIREMENTS = "requirements"
    STEPS = "steps"
    TREE = "tree"
    SYSTEM = "system"
    CHANNELS = "channels"
    PROTOCOLS = "protocols"
    INTERFACES = "interfaces"
    RIGHTS = "rights"
    BUFFERS = "buffers"
    MACHINES = "machines"


class Choice(msgspec.Struct, frozen=True):
    """The selection: kind, step, agent, protocol; `width`: of the text, in letters."""

    what: tuple[What, ...] = (What.ALL,)
    step: int | None = None
    agent: str | None = None
    protocol: str | None = None
    width: int = document.WIDTH


EVERYTHING = Choice()


def sections(design: Design, choice: Choice = EVERYTHING) -> tuple[Section, ...]:
    """The sections of a choice. Raises NoSuchEntry."""
    makers: dict[What, Callable[[], Section]] = {
        What.REQUIREMENTS: lambda: decomposition.requirements_section(design, choice.width),
        What.STEPS: lambda: decomposition.steps_section(design, choice.step, choice.width),
        What.TREE: lambda: decomposition.tree_section(design, choice.step, choice.width),
        What.SYSTEM: lambda: system.system_section(design, choice.width),
        What.CHANNELS: lambda: system.channels_section(design),
        What.PROTOCOLS: lambda: protocols.section(design, choice.protocol, choice.width),
        What.INTERFACES: lambda: system.interfaces(design, choice.agent),
        What.RIGHTS: lambda: system.rights_section(design, choice.agent),
        What.BUFFERS: lambda: system.buffers(design),
        What.MACHINES: lambda: machines.section(design, choice.agent),
    }
    return tuple(makers[what]() for what in makers if {what, What.ALL} & set(choice.what))


def page_of(design: Design, found: tuple[Section, ...]) -> str:
    """The HTML page of sections of a design."""
    return page(f"The design of {design.file.system.name}", design.file.system.text, found)


def figures(found: tuple[Section, ...]) -> dict[str, str]:
    """The drawings of sections as SVG files: name of the file -> its text."""
    parts = (part for section in found for part in section.parts if isinstance(part, Figure))
    return {f"{part.name}.svg": part.canvas.svg() for part in parts}
