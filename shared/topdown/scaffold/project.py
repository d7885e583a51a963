"""Makes a project's files of a design, all or nothing: names are looked at before anything is
written.

The files are in templates/, as `string.Template` texts: PACKAGE, AGENT and LANGUAGE in a path stand
for names of the design. What depends on the number of entries, or has to be wrapped as ruff's
formatter does, is written here.
"""

import ast
import hashlib
import importlib.util
import keyword
import re
import sys
import textwrap
from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path
from string import Template

import msgspec

from topdown.model import elements, loading
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


# --- The files ------------------------------------------------------------------------------------


KEY = "roco/{system}/{channel}/{sender}/{receiver}/{protocol}/{performative}"
"""The key template that agent_runtime.core.wiring puts communicates on; a design that runs on it
has this one.
"""
_SMALLEST = Path(__file__).with_name("smallest.toml")
_TEMPLATES = Path(__file__).with_name("templates")
# The order of these lists is that of the project's manifest, so that a manifest written before
# stays the same.
_ONCE = (
    *(
        f"PACKAGE/{name}"
        for name in ("__init__.py", "py.typed", "design.py", "__main__.py", "system.py")
    ),
    *("pyproject.toml", "compose.yaml", "README.md", ".gitignore", "PACKAGE/languages/__init__.py"),
)
_OF_AGENT = tuple(
    f"PACKAGE/AGENT/{name}.py"
    for name in ("__init__", "__main__", "interface", "memory", "behaviours")
)


def smallest(name: str) -> str:
    """The text of the smallest design that runs: two agents, one channel, one protocol."""
    return _SMALLEST.read_text(encoding="utf-8").replace("NAME", name)


def scaffold(
    design_text: str, folder: Path, package: str = "", file: str = "design.toml"
) -> "Outcome":
    """Write the project into `folder`; `package` "": the system's name. Raises DesignError,
    ScaffoldError, OSError.
    """
    package = package or loading.read(design_text, file).system.name
    outcome = write(folder, project_files(design_text, package, file))
    if any(kept.path == f"{package}/design.toml" for kept in outcome.kept):
        target = folder / package / "design.toml"
        where, wrong = str(target), f"was changed and differs from {file}"
        raise ScaffoldError(where, wrong, f"make the project of it: --from {target}")
    return outcome


def project_files(design_text: str, package: str, file: str = "design.toml") -> dict[str, str]:
    """Path -> text of every file of the project. Raises DesignError, ScaffoldError."""
    design = Design(loading.read(design_text, file), file)
    require_names(design, package)
    if design.file.system.key != KEY:
        wrong = f"is {design.file.system.key!r}"
        raise ScaffoldError(f"{file}: system.key", wrong, f"the runtime's keys are {KEY!r}")
    if slips := design.decomposition.slips:
        raise ScaffoldError(f"{file}: step {slips[0].step}", slips[0].wrong, slips[0].right)
    files = {f"{package}/design.toml": design_text}

    def make(template: str, words: dict[str, str], **names: str) -> None:
        path, names = template, names | {"package": package}
        for name, value in names.items():
            path = path.replace(name.upper(), value)
        files[path] = _filled(template, words | names)

    once = _of_project(design, package)
    for path in _ONCE:
        make(path, once)
    said = classes(design)
    for language in design.file.language:
        words = _of_language(design, language, said[language.name])
        make("PACKAGE/languages/LANGUAGE.py", words, language=module(language.name))
    for path in ("tests/test_design.py", "tests/test_run.py"):
        make(path, {})
    for agent in design.agents:
        words = _asked(design, package, agent)
        make("tests/test_AGENT.py", words, agent=agent)
        if words["asked"]:
            files[f"tests/test_{agent}.py"] += _filled("tests/answered.py", {})
    for agent in design.agents:
        text = sentence(
            design.agent(agent).text or design.decomposition.tasks.get(agent, ""),
            "its task is not said",
        )
        parts = (
            {"about": docstring(f"a_{agent}. {text}")},
            _process(package, agent, text),
            _interface(design, package, agent),
            _memory(design, agent),
            _behaviours(design, package, agent, text),
        )
        for path, words in zip(_OF_AGENT, parts, strict=True):
            make(path, words, agent=agent)
    return files


def _filled(template: str, words: dict[str, str]) -> str:
    return Template((_TEMPLATES / f"{template}.txt").read_text(encoding="utf-8")).substitute(words)


# --- once in a project ----------------------------------------------------------------------------


def _of_project(design: Design, package: str) -> dict[str, str]:
    system, tasks = design.file.system, design.decomposition.tasks
    told = {
        f"python -m {package}": (
            "router and agents as processes; prints what they say; Ctrl-C ends them"
        ),
        "roco up": (
            "the same in the background; roco status, traffic echo, graph, top, down are about it"
        ),
        "python -m pytest": (
            "the design is consistent, every agent binds and answers, all meet over Zenoh"
        ),
        f"roco design check {package}/design.toml": "what is wrong with the design, and where",
        f"roco design verify {package}/design.toml": "whether it can go wrong, and how",
    }
    width = max(map(len, told))
    languages = [f"{module(entry.name)}.LANGUAGE" for entry in design.file.language]
    return {
        "title": docstring(f"{system.name}: {system.text or 'a system designed top-down'}."),
        "purpose": sentence(system.text, "A system designed top-down"),
        "capitals": package.upper(),
        "agents": wrapped("AGENTS = (", [f'"{agent}"' for agent in design.agents], ")"),
        "places": ",".join(f"{agent}=tcp/{agent}:7448" for agent in design.agents),
        "services": "\n".join(
            f"  {one}:\n    <<: *agent\n    command: [{package}.{one}]\n" for one in design.agents
        ),
        "table": "\n".join(
            f"| `{agent}` | {sentence(entry.text or tasks.get(agent, ''), 'not said')} |"
            for agent, entry in design.agents.items()
        ),
        "commands": "\n".join(f"{command:<{width}}  # {what}" for command, what in told.items()),
        "modules": ", ".join(sorted(module(language.name) for language in design.file.language)),
        "languages": wrapped(
            "LANGUAGES = Languages((", languages, ",))" if len(languages) == 1 else "))"
        ),
    }


# --- the content languages: one Struct for each class that the design names, fields to fill in ----


def _of_language(
    design: Design, language: elements.Language, words: tuple[str, ...]
) -> dict[str, str]:
    # class -> in which acts it is said
    said: dict[str, dict[str, None]] = {word: {} for word in words}
    for use in design.file.protocol:
        for message in use.message:
            for name in design.contents(use, message):
                spoken, _, word = name.partition(".")
                if spoken == language.name:
                    said[word][f"{message.performative} of {message.sender} in {use.name}"] = None
    blocks = []
    for word, acts in said.items():
        about = sentence(", ".join(acts), f"{word}: fields to fill in").removesuffix(".") + "."
        blocks.append(f"class {word}(Sentence, frozen=True):\n{docstring(about, 4)}\n\n\n")
    line = " | ".join(words) or "Sentence"
    union = f"Content = {line}"
    if len(union) > WIDTH:
        lines = (
            (line,)
            if len(f"    {line}") <= WIDTH
            else (words[0], *(f"| {word}" for word in words[1:]))
        )
        union = "\n".join(("Content = (", *(f"    {one}" for one in lines), ")"))
    about = (
        f"{language.name}: {language.text or 'a content language of the design'}.\n\nGive each"
        " sentence its fields; msgspec checks them on the way in. Where a protocol tells uses of"
        " inform apart (progress, final), give the Language a `kind`: a function of the sentence."
    )
    return {
        "about": docstring(about),
        "name": language.name,
        "classes": "".join(blocks),
        "union": union,
    }


# --- an agent -------------------------------------------------------------------------------------


def _process(package: str, agent: str, text: str) -> dict[str, str]:
    told = textwrap.shorten(text, 80, placeholder=" ...").replace("\\", "\\\\").replace('"', "'")
    return {
        "imports": imports(
            f"from {package}.{agent}.behaviours import agent",
            f"from {package}.design import DESIGN, LANGUAGES",
        ),
        "run": wrapped("    cli.run(", [f'"{agent}"', f'"a_{agent}. {told}"', "serve"], ")"),
    }


def _interface(design: Design, package: str, agent: str) -> dict[str, str]:
    offers = _table(
        design, "OFFERS", [use for use in design.file.protocol if use.participant == agent]
    )
    asks = _table(design, "ASKS", [use for use in design.file.protocol if use.initiator == agent])
    words = f"{offers}\n{asks}".replace("[", " ").replace("(", " ")
    used = sorted(
        {name for entry in design.file.language if f" {(name := module(entry.name))}." in words}
    )
    return {
        "about": docstring(
            f"Requests that a_{agent} takes (OFFERS) and makes (ASKS), by the use of a protocol."
        ),
        "imports": f"\nfrom {package}.languages import {', '.join(used)}\n" if used else "",
        "offers": offers,
        "asks": asks,
    }


def _table(design: Design, name: str, uses: list[elements.Protocol]) -> str:
    """The interface entries of some uses as a table of Python, wrapped like ruff's formatter
    does.
    """
    if not uses:
        return f"{name}: dict[str, ClassInterfaceInfo] = {{}}"

    def dotted(names: tuple[str, ...], between: str) -> str:
        return between.join(
            f"{module(language)}.{word}"
            for language, _, word in (one.partition(".") for one in names)
        )

    def own_line(words: str) -> str:  # a union that is too long for a line stands in several
        return words if 16 + len(words) < WIDTH else words.replace(" | ", f"\n{' ' * 16}| ")

    lines = [f"{name} = {{"]
    for use in uses:
        entries = [
            (
                f'"{entry.performative}"',
                f'"{entry.name}"',
                f"[{dotted(entry.arguments, ', ')}]",
                dotted(entry.answers, " | ") or "None",
            )
            for entry in design.entries(use.name)
        ]
        flat = ", ".join(f"({', '.join(parts)})" for parts in entries)
        line = f'    "{use.name}": ClassInterfaceInfo([{flat}]),'
        opening = (f'    "{use.name}": ClassInterfaceInfo(', "        [")
        rows = (
            wrapped("            (", [own_line(part) for part in entry], "),") for entry in entries
        )
        lines += [line] if len(line) <= WIDTH else [*opening, *rows, "        ]", "    ),"]
    return "\n".join((*lines, "}"))


def _memory(design: Design, agent: str) -> dict[str, str]:
    entry, conditions = design.agent(agent), sorted(design.conditions(agent))
    blocks = []
    for name in conditions:
        purpose = [f"ends state {state.name}" for state in entry.state if state.terminal == name]
        purpose += [
            f"ends state {state.name} as an error" for state in entry.state if state.error == name
        ]
        purpose += [
            f"leads from {arc.source} to {arc.target}" for arc in entry.arc if arc.when == name
        ]
        about = docstring(sentence("; ".join(purpose), name), 4)
        blocks.append(
            f"def {name}(memory: Memory) -> bool:\n{about}\n    return False  # to fill in\n\n\n"
        )
    about = (
        f"Memory of a_{agent}, and the conditions of its states and arcs. Must not know: messages."
    )
    return {
        "about": docstring(about),
        "conditions": "".join(blocks),
        "table": wrapped("CONDITIONS = {", [f'"{name}": {name}' for name in conditions], "}"),
    }


def _behaviours(design: Design, package: str, agent: str, text: str) -> dict[str, str]:
    entry = design.agent(agent)
    states: dict[str, list[elements.State]] = {}
    for state in entry.state:
        states.setdefault(state.behaviour, []).append(state)
    head = (
        f"a_{agent}. {text} Its behaviours, bound to the states of design.toml by name.\n\nA"
        " behaviour is called once without an event when its state is entered, then once for each"
        " event; it gives the memory as it then is, and says what is to be said through the turn."
        " Must not know: clocks, the wire."
    )
    blocks = []
    for name, served in states.items():
        about = docstring("\n".join(_purpose(design, entry, served)), 4)
        blocks.append(
            f"def {name}(memory: Memory, turn: Turn) -> Memory:\n{about}\n"
            f'    return unfilled(memory, turn, "{name}")  # to fill in\n\n\n'
        )
    opening = "BEHAVIOURS: dict[str, Transition[Memory]] = {"
    return {
        "about": docstring(head),
        "imports": imports(
            f"from {package}.{agent}.memory import CONDITIONS, Memory",
            f"from {package}.design import DESIGN",
        ),
        "behaviours": "".join(blocks),
        "table": wrapped(opening, [f'"{name}": {name}' for name in states], "}"),
    }


def _purpose(design: Design, entry: elements.Agent, states: list[elements.State]) -> Iterator[str]:
    """Lines that say what a behaviour is for: its states, how they end, what the rows want of
    them.
    """
    names = {state.name for state in states}
    what = "; ".join(state.text for state in states if state.text)
    yield (
        f"Behaviour of {' and '.join(f'`{state.name}`' for state in states)}: {what or 'not said'}."
    )
    yield ""
    ends = " or ".join(
        dict.fromkeys(f"`{name}`" for s in states for name in (s.terminal, s.error) if name)
    )
    arcs = (arc for arc in entry.arc if arc.source in names)
    targets = ", ".join(f"{arc.target} if {arc.when}" if arc.when else arc.target for arc in arcs)
    yield f"Ends when {ends} holds; then {targets or 'nowhere'}."
    for row in entry.row:
        if names & set(row.in_):
            wanted = {
                "if": row.when,
                "say": row.say,
                "may say": row.may,
                "owe": row.owes,
                "let wait": row.waits,
                "drop": row.drop,
                "go on by choice": (row.then,) if row.then else (),
                "then": (row.to,) if row.to else (),
            }
            parts = [f"{verb} {', '.join(things)}" for verb, things in wanted.items() if things]
            yield f"- on {row.on}: {'; '.join(parts) or 'note it'}"
    if entry.row:
        return
    for name in dict.fromkeys(name for state in states for name in state.talks):
        use = design.protocol(name)
        peer = use.peer(entry.name)
        said: dict[str, list[str]] = {peer: [], entry.name: []}
        for message in use.message:
            contents = " | ".join(
                content.partition(".")[2] for content in design.contents(use, message)
            )
            said[message.sender].append(f"{message.performative} {contents}".strip())
        hears, says = ", ".join(said[peer]), ", ".join(said[entry.name])
        yield f"- {name}: {use.follows} with {peer}; hears {hears}; says {says}"


def _asked(design: Design, package: str, agent: str) -> dict[str, str]:
    """The test of an agent asks it whatever it may be asked first."""
    rows = []
    for use in design.file.protocol:
        table = design.tables.get(use.follows)
        if use.participant != agent or table is None:
            continue
        for message in use.message:
            if message.sender == use.initiator and message.performative in table.openings:
                for content in design.contents(use, message) or ("",):
                    rows.append(
                        f'    ("{use.initiator}", "{use.follows}", P("{message.performative}"),'
                        f' "{content}"),\n'
                    )
    samples = (
        "from agent_runtime.testing.samples import sample_named\n"
        "from fipa_codec.performatives import Performative as P\n"
    )
    return {
        "pytest": "import pytest\n" if rows else "",
        "samples": samples if rows else "",
        "imports": imports(
            f"from {package}.{agent} import interface",
            f"from {package}.{agent}.behaviours import agent",
            f"from {package}.design import DESIGN, INTERFACES, LANGUAGES",
        ),
        "asked": f"\nASKED = [\n{''.join(rows)}]\n" if rows else "",
    }


# --- Writes a project's files and never overwrites one that was changed since ---------------------
# `.scaffold.json` remembers what was written. The only files this touches are those it is given
# and that one.


MANIFEST = ".scaffold.json"


class Kept(msgspec.Struct, frozen=True):
    """A file that somebody changed and that was not touched; `missing`: names that no own file
    mentions.
    """

    path: str
    missing: tuple[str, ...] = ()


class Outcome(msgspec.Struct, frozen=True):
    """Paths relative to `folder`: `written` (new or changed), `same` as they were, `kept`; `left`:
    no longer made.
    """

    folder: str
    written: tuple[str, ...]
    same: tuple[str, ...]
    kept: tuple[Kept, ...]
    left: tuple[str, ...]


def write(folder: Path, files: dict[str, str]) -> Outcome:
    """Write what is new, rewrite what nobody touched, keep the rest. Raises OSError."""
    try:
        known = msgspec.json.decode((folder / MANIFEST).read_bytes(), type=dict[str, str])
    except (OSError, msgspec.MsgspecError):
        known = {}
    written: list[str] = []
    same: list[str] = []
    kept: list[str] = []
    for path, text in files.items():
        target = folder / path
        present = target.read_text(encoding="utf-8") if target.exists() else None
        if present == text:
            same.append(path)
        elif present is None or known.get(path) == _sum(present):
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_text(text, encoding="utf-8")
            written.append(path)
        else:
            kept.append(path)
            continue
        known[path] = _sum(text)
    left = tuple(path for path in known if path not in files and (folder / path).exists())
    folder.mkdir(parents=True, exist_ok=True)
    (folder / MANIFEST).write_bytes(
        msgspec.json.format(msgspec.json.encode(known), indent=1) + b"\n"
    )
    made = files.keys() - kept
    # all Python that a user wrote: what is bound in one of these files may be defined in another
    others = (
        [path for path in folder.rglob("*.py") if path.relative_to(folder).as_posix() not in made]
        if kept
        else []
    )
    own = "\n".join(path.read_text(encoding="utf-8", errors="replace") for path in others)
    changed = tuple(
        Kept(path, missing(files[path], own) if path.endswith(".py") else ()) for path in kept
    )
    return Outcome(str(folder), tuple(written), tuple(same), changed, left)


def missing(wanted: str, present: str) -> tuple[str, ...]:
    """Functions, classes and tables that `wanted` defines and `present` does not so much as
    mention.
    """
    words = set(re.findall(r"\w+", present))
    return tuple(name for name in _defined(wanted) if name not in words)


def _defined(text: str) -> list[str]:
    names = []
    for node in ast.parse(text).body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            names.append(node.name)
        elif isinstance(node, ast.Assign):
            names += [target.id for target in node.targets if isinstance(target, ast.Name)]
    return names


def _sum(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()
