"""Names of a design as names of Python: packages, modules, functions, classes; and texts as
docstrings.
"""

import importlib.util
import keyword
import re
import sys
import textwrap
from collections import Counter
from collections.abc import Iterable

from topdown.model.design import Design
from topdown.model.errors import TopdownError

# --- Errors of the scaffold; one kind: no project can be made, because of a name or a folder ------


class ScaffoldError(TopdownError):
    """No project can be made of this: `where`, what is `wrong`, what would be `right`."""

    def __init__(self, where: str, wrong: str, right: str) -> None:
        self.where, self.wrong, self.right = where, wrong, right
        super().__init__(f"{where}: {wrong}; {right}")


# --- Names of a design as names of Python ---------------------------------------------------------


WIDTH = 120
RESERVED = ("design", "languages", "tests")
"""Names inside a project's package that an agent's package may not take."""
IMPORTED = ("agent_runtime", "fipa_codec", "services", "topdown")
"""Packages that a project imports, so none of its own may hide them."""
_WORD = re.compile(r"[A-Za-z][A-Za-z0-9_]*")


def require_names(design: Design, package: str) -> None:
    """ScaffoldError names the first name of the design that can be no name in Python, and what
    can.
    """
    _package(package)
    for agent in design.agents:
        _identifier(f"agent {agent!r}", agent)
        if agent in RESERVED:
            raise ScaffoldError(
                f"agent {agent!r}", "has the name of a module of the project", "name it otherwise"
            )
    for agent, entry in design.agents.items():
        for state in entry.state:
            _identifier(f"agent {agent}, behaviour", state.behaviour)
        for condition in design.conditions(agent):
            _identifier(f"agent {agent}, condition", condition)
    for language in design.file.language:
        _identifier("language", language.name, keywords=True)
    doubled = [
        name
        for name, count in Counter(module(entry.name) for entry in design.file.language).items()
        if count > 1
    ]
    if doubled:
        raise ScaffoldError(
            "languages",
            f"several would be module {doubled[0]}",
            "let them differ in more than capitals",
        )


def _package(name: str) -> None:
    _identifier("system", name)
    if name != name.lower():
        raise ScaffoldError(
            "system", f"{name!r} is not a name of a package", f"write it small: {name.lower()!r}"
        )
    # a package from outside, and not the project itself, made before
    known = importlib.util.find_spec(name)
    installed = known is not None and known.origin is not None and "site-packages" in known.origin
    if name in IMPORTED or name in sys.stdlib_module_names or installed:
        raise ScaffoldError(
            "system", f"{name!r} is an installed package", "choose a name that is free"
        )


def _identifier(where: str, name: str, *, keywords: bool = False) -> None:
    if not _WORD.fullmatch(name) or (keyword.iskeyword(name) and not keywords):
        raise ScaffoldError(
            where, f"{name!r} is not a name in Python", "letters, digits and _, a letter first"
        )


def module(language: str) -> str:
    """The module of a content language."""
    name = language.lower()
    return f"{name}_" if keyword.iskeyword(name) else name


def classes(design: Design) -> dict[str, tuple[str, ...]]:
    """Names of the classes that the design uses of each of its languages, in the order of the
    file.
    """
    found: dict[str, dict[str, None]] = {entry.name: {} for entry in design.file.language}
    named = [
        name
        for entry in design.file.interface
        for row in entry.entries
        for name in (*row.arguments, *row.answers)
    ]
    for use in design.file.protocol:
        named += [name for message in use.message for name in design.contents(use, message)]
    for name in named:
        language, _, word = name.partition(".")
        found.setdefault(language, {})[word] = None
    return {language: tuple(words) for language, words in found.items()}


def docstring(text: str, indent: int = 0) -> str:
    """A docstring of whole lines, wrapped; a blank line parts the paragraphs, lines that begin with
    `- ` are kept.
    """
    safe = text.strip().replace("\\", "\\\\").replace('"""', "'''")
    pad = " " * indent
    lines: list[str] = []
    for paragraph in safe.split("\n"):
        first = ' "' if not lines else ""
        width = WIDTH - indent - (3 if first else 0)
        more = "  " if paragraph.startswith("- ") else ""
        lines += textwrap.wrap(
            paragraph, width, subsequent_indent=more, break_long_words=False
        ) or [""]
    if len(lines) == 1 and len(lines[0]) + indent + 6 <= WIDTH:
        return f'{pad}"""{lines[0]}"""'
    body = "\n".join(f"{pad}{line}".rstrip() for line in lines[1:])
    return f'{pad}"""{lines[0]}\n{body}\n{pad}"""' if body else f'{pad}"""{lines[0]}\n{pad}"""'


def sentence(text: str, otherwise: str) -> str:
    """A text as a sentence: a capital first, a full stop last."""
    words = " ".join(text.split()) or otherwise
    return words[0].upper() + words[1:] + ("" if words.endswith(".") else ".")


def wrapped(opening: str, items: Iterable[str], closing: str) -> str:
    """A bracketed list as ruff's formatter writes it: on one line where that fits, else one item a
    line.
    """
    kept = list(items)
    line = f"{opening}{', '.join(kept)}{closing}"
    if len(line) <= WIDTH or not kept:
        return line
    pad = " " * (len(opening) - len(opening.lstrip()))
    return "\n".join((opening, *(f"{pad}    {item}," for item in kept), f"{pad}{closing}"))


def imports(*lines: str) -> str:
    """Import lines of the project's own modules in the order that tools want."""
    return "\n".join(sorted(lines, key=lambda line: line.split()[1]))
