"""The whole book about a design, or a part of it: which sections there are, and what each is made from."""

from collections.abc import Callable
from enum import StrEnum

import msgspec

from topdown.draw import channels, machines, page, protocols, requirements, steps, system, text
from topdown.draw.document import Figure, Section
from topdown.model.design import Design


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
    BUFFERS = "buffers"
    MACHINES = "machines"


class Choice(msgspec.Struct, frozen=True):
    """The selection: kind, step, agent, protocol; `width`: of the text, in letters."""

    what: tuple[What, ...] = (What.ALL,)
    step: int | None = None
    agent: str | None = None
    protocol: str | None = None
    width: int = text.WIDTH


EVERYTHING = Choice()


def sections(design: Design, choice: Choice = EVERYTHING) -> tuple[Section, ...]:
    """The sections of a choice. Raises NoSuchEntry."""
    makers: dict[What, Callable[[], Section]] = {
        What.REQUIREMENTS: lambda: requirements.section(design, choice.width),
        What.STEPS: lambda: steps.section(design, choice.step, choice.width),
        What.TREE: lambda: steps.tree_section(design, choice.step, choice.width),
        What.SYSTEM: lambda: system.section(design, choice.width),
        What.CHANNELS: lambda: channels.section(design),
        What.PROTOCOLS: lambda: protocols.section(design, choice.protocol, choice.width),
        What.INTERFACES: lambda: channels.interfaces(design, choice.agent),
        What.BUFFERS: lambda: channels.buffers(design),
        What.MACHINES: lambda: machines.section(design, choice.agent),
    }
    return tuple(makers[what]() for what in makers if {what, What.ALL} & set(choice.what))


def page_of(design: Design, found: tuple[Section, ...]) -> str:
    """The HTML page of sections of a design."""
    return page.page(f"The design of {design.file.system.name}", design.file.system.text, found)


def figures(found: tuple[Section, ...]) -> dict[str, str]:
    """The drawings of sections as SVG files: name of the file -> its text."""
    parts = (part for section in found for part in section.parts if isinstance(part, Figure))
    return {f"{part.name}.svg": part.canvas.svg() for part in parts}
