"""`roco design show`: what the method's paper has in tables and figures, of any design file, as
text, SVG and HTML.
"""

import shutil
from pathlib import Path
from typing import Annotated

import msgspec

from console import completion
from console.design import files
from console.errors import NO
from console.output import Form, Format, option
from topdown.draw import book, document
from topdown.draw.document import Figure, Section
from topdown.model.design import load


def show(
    file: files.File = None,
    what: Annotated[list[book.What] | None, option("What to show; may be repeated.")] = None,
    step: Annotated[
        int | None,
        option(
            "Of steps and tree: after which step; else all, and the last.",
            complete=completion.steps,
        ),
    ] = None,
    agent: Annotated[
        str | None,
        option("Of interfaces and machines: whose; else all.", complete=completion.agents),
    ] = None,
    protocol: Annotated[
        str | None,
        option(
            "Of protocols: which use, or the table they follow.",
            complete=completion.protocols_and_uses,
        ),
    ] = None,
    html: Annotated[Path | None, option("Write one self-contained page of it here.")] = None,
    svg: Annotated[Path | None, option("Write its figures into this folder.")] = None,
    long: Annotated[
        bool, option("Also the rows behind diagrams, which a page folds.", "--long")
    ] = False,
    form: Form = Format.TEXT,
) -> None:
    """Show a design: requirements, steps, channels, protocols, the system, state machines.

    Examples:
      roco design show
      roco design show --agent AGENT
      roco design show --what system
    """
    with files.problems(form, NO):
        chosen = chosen_of(what or [], step, agent, protocol)
        width = shutil.get_terminal_size((document.WIDTH, 0)).columns
        design = load(files.meant(file))
        choice = book.Choice(chosen, step, agent, protocol, max(40, width))
        sections = book.sections(design, choice)
        made = write(book.page_of(design, sections), html) + write_all(book.figures(sections), svg)
        if form is Format.JSON:
            print(msgspec.json.encode([plain(section) for section in sections]).decode())
        elif made:
            print("\n".join(f"wrote {path}" for path in made))
        else:
            print(document.written(sections, max(40, width), long), end="")


def chosen_of(
    what: list[book.What], step: int | None, agent: str | None, protocol: str | None
) -> tuple[book.What, ...]:
    """The sections that are meant: those named; else those that a step, an agent or a protocol is
    of; else all.
    """
    if what:
        return tuple(what)
    meant = {
        book.What.STEPS: step is not None,
        book.What.INTERFACES: agent is not None,
        book.What.MACHINES: agent is not None,
        book.What.PROTOCOLS: protocol is not None,
    }
    return tuple(one for one, is_meant in meant.items() if is_meant) or (book.What.ALL,)


def plain(section: Section) -> dict[str, object]:
    """A section as plain data: tables by their heads, figures by what they show."""
    parts: list[dict[str, object]] = []
    for part in section.parts:
        if isinstance(part, Figure):
            told = {"figure": part.name, "caption": part.caption, "data": part.data}
        else:
            told = {"table": part.title, "head": part.head, "rows": part.rows}
        parts.append({**told, "notes": part.notes})
    return {"what": section.what, "title": section.title, "parts": parts}


def write(words: str, path: Path | None) -> list[Path]:
    """Write a file, if there is a path; the files written."""
    if path is None:
        return []
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(words, encoding="utf-8")
    return [path]


def write_all(texts: dict[str, str], folder: Path | None) -> list[Path]:
    """Write files into a folder, if there is one."""
    if folder is None:
        return []
    return [path for name, words in texts.items() for path in write(words, folder / name)]
