"""Makes a project's files of a design, all or nothing: names are looked at before anything is
written.

The files are in templates/, as `string.Template` texts: PACKAGE, AGENT and LANGUAGE in a path stand
for names of the design. What depends on the number of entries, or has to be wrapped as ruff's
formatter does, is written here.
"""

import textwrap
from collections.abc import Iterator
from pathlib import Path
from string import Template

from topdown.model import elements, loading
from topdown.model.design import Design
from topdown.scaffold.naming import (
    WIDTH,
    ScaffoldError,
    classes,
    docstring,
    imports,
    module,
    require_names,
    sentence,
    wrapped,
)
from topdown.scaffold.writing import Outcome, write

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
) -> Outcome:
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
        peer = use.participant if use.initiator == entry.name else use.initiator
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
