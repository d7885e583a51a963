"""The packages of a project's agents: memory and conditions, behaviours, typed interface, process, tests."""

import textwrap
from collections.abc import Iterator

from fipa_codec.performatives import Performative
from topdown.model import elements
from topdown.model.design import Design
from topdown.scaffold.naming import WIDTH, docstring, imports, module, sentence, wrapped


def agent_files(design: Design, package: str, agent: str) -> dict[str, str]:
    """Path -> text of one agent's package."""
    folder = f"{package}/{agent}"
    text = sentence(design.agent(agent).text or design.decomposition.tasks.get(agent, ""), "its task is not said")
    return {
        f"{folder}/__init__.py": f"{docstring(f'a_{agent}. {text}')}\n",
        f"{folder}/__main__.py": _main(package, agent, text),
        f"{folder}/interface.py": _interface(design, package, agent),
        f"{folder}/memory.py": _memory(design, agent),
        f"{folder}/behaviours.py": _behaviours(design, package, agent, text),
    }


def _main(package: str, agent: str, text: str) -> str:
    own = imports(f"from {package}.{agent}.behaviours import agent", f"from {package}.design import DESIGN, LANGUAGES")
    told = textwrap.shorten(text, 80, placeholder=" ...").replace("\\", "\\\\").replace('"', "'")
    return f'''"""a_{agent} as a process: `python -m {package}.{agent} --help`."""

from agent_runtime.core.binding import wiring
from agent_runtime.io import cli, shell
from agent_runtime.io.options import Options

{own}


def serve(options: Options) -> int:
    """Run until a signal; a device of the agent (agent_runtime.io.devices) would be the last argument of `run`."""
    wired = wiring("{agent}", options.system, design=DESIGN, languages=LANGUAGES)
    return shell.run(agent(), wired, options)


if __name__ == "__main__":
{wrapped("    cli.run(", [f'"{agent}"', f'"a_{agent}. {told}"', "serve"], ")")}
'''


# --- the typed interface ----------------------------------------------------------------------------------------------


def _interface(design: Design, package: str, agent: str) -> str:
    offers = [use for use in design.file.protocol if use.participant == agent]
    asks = [use for use in design.file.protocol if use.initiator == agent]
    tables = "\n\n".join((_table(design, "OFFERS", offers), _table(design, "ASKS", asks)))
    used = sorted({module(lang.name) for lang in design.file.language if f" {module(lang.name)}." in _spaced(tables)})
    lines = ["from fipa_codec.interfaces import ClassInterfaceInfo"]
    if used:
        lines += ["", f"from {package}.languages import {', '.join(used)}"]
    head = docstring(f"Requests that a_{agent} takes (OFFERS) and makes (ASKS), by the use of a protocol.")
    return f"{head}\n\n" + "\n".join(lines) + f"\n\n{tables}\n"


def _spaced(text: str) -> str:
    return text.replace("[", " ").replace("(", " ")


def _table(design: Design, name: str, uses: list[elements.Protocol]) -> str:
    if not uses:
        return f"{name}: dict[str, ClassInterfaceInfo] = {{}}"
    lines = [f"{name} = {{"]
    for use in uses:
        entries = [_entry(entry) for entry in design.entries(use.name)]
        flat = ", ".join(f"({', '.join(parts)})" for parts in entries)
        line = f'    "{use.name}": ClassInterfaceInfo([{flat}]),'
        opening = (f'    "{use.name}": ClassInterfaceInfo(', "        [")
        rows = (wrapped("            (", [_union(part, 16) for part in entry], "),") for entry in entries)
        lines += [line] if len(line) <= WIDTH else [*opening, *rows, "        ]", "    ),"]
    return "\n".join((*lines, "}"))


def _entry(entry: elements.InterfaceEntry) -> tuple[str, ...]:
    arguments = ", ".join(_dotted(name) for name in entry.arguments)
    answers = " | ".join(_dotted(name) for name in entry.answers) or "None"
    return f'"{entry.performative}"', f'"{entry.name}"', f"[{arguments}]", answers


def _union(words: str, indent: int) -> str:
    """Return an expression that stands on a line of its own, a union that is too long for that in several."""
    return words if indent + len(words) < WIDTH else words.replace(" | ", f"\n{' ' * indent}| ")


def _dotted(name: str) -> str:
    language, _, word = name.partition(".")
    return f"{module(language)}.{word}"


# --- memory and behaviours --------------------------------------------------------------------------------------------


def _memory(design: Design, agent: str) -> str:
    conditions = sorted(design.conditions(agent))
    parts = [
        docstring(f"Memory of a_{agent}, and the conditions of its states and arcs. Must not know: messages."),
        "\nimport msgspec\n\n",
        "class Memory(msgspec.Struct, frozen=True, omit_defaults=True):",
        '    """Kept in the journal whenever it changes. Fields to fill in, each with a default."""\n\n',
    ]
    for name in conditions:
        parts += [f"def {name}(memory: Memory) -> bool:", docstring(_condition(design.agent(agent), name), 4)]
        parts.append("    return False  # to fill in\n\n")
    parts.append(wrapped("CONDITIONS = {", [f'"{name}": {name}' for name in conditions], "}"))
    return "\n".join((*parts, ""))


def _condition(entry: elements.Agent, name: str) -> str:
    """Return the purpose of a condition in words."""
    ends = [f"ends state {state.name}" for state in entry.state if state.terminal == name]
    ends += [f"ends state {state.name} as an error" for state in entry.state if state.error == name]
    arcs = [f"leads from {arc.source} to {arc.target}" for arc in entry.arc if arc.when == name]
    return sentence("; ".join((*ends, *arcs)), name)


def _behaviours(design: Design, package: str, agent: str, text: str) -> str:
    entry = design.agent(agent)
    states: dict[str, list[elements.State]] = {}
    for state in entry.state:
        states.setdefault(state.behaviour, []).append(state)
    head = f"a_{agent}. {text} Its behaviours, bound to the states of design.toml by name.\n\n"
    head += (
        "A behaviour is called once without an event when its state is entered, then once for each event; it gives the "
    )
    head += "memory as it then is, and says what is to be said through the turn. Must not know: clocks, the wire."
    parts = [docstring(head), _imports(package, agent)]
    for behaviour, served in states.items():
        parts += [
            f"def {behaviour}(memory: Memory, turn: Turn) -> Memory:",
            docstring("\n".join(_about(design, entry, served)), 4),
            f'    return unfilled(memory, turn, "{behaviour}")  # to fill in\n\n',
        ]
    table = "BEHAVIOURS: dict[str, Transition[Memory]] = {"
    parts.append(wrapped(table, [f'"{name}": {name}' for name in states], "}"))
    parts.append(
        f'\n\ndef agent() -> Agent[Memory]:\n    """The agent {agent}."""\n'
        f'    return bind("{agent}", Memory(), BEHAVIOURS, CONDITIONS, design=DESIGN)\n'
    )
    return "\n".join(parts)


def _imports(package: str, agent: str) -> str:
    return "\n".join(
        (
            "\nfrom agent_runtime.core.agent import Agent",
            "from agent_runtime.core.binding import Transition, bind",
            "from agent_runtime.core.declining import unfilled",
            "from agent_runtime.core.turn import Turn\n",
            imports(f"from {package}.{agent}.memory import CONDITIONS, Memory", f"from {package}.design import DESIGN"),
            "\n",
        )
    )


def _about(design: Design, entry: elements.Agent, states: list[elements.State]) -> Iterator[str]:
    """Lines that say what a behaviour is for: its states, how they end, what the rows want of them."""
    names = {state.name for state in states}
    what = "; ".join(state.text for state in states if state.text)
    yield f"Behaviour of {' and '.join(f'`{state.name}`' for state in states)}: {what or 'not said'}."
    yield ""
    ends = " or ".join(dict.fromkeys(f"`{name}`" for s in states for name in (s.terminal, s.error) if name))
    targets = ", ".join(
        f"{arc.target} if {arc.when}" if arc.when else arc.target for arc in entry.arc if arc.source in names
    )
    yield f"Ends when {ends} holds; then {targets or 'nowhere'}."
    for row in entry.row:
        if names & set(row.in_):
            yield f"- on {row.on}: {_row(row)}"
    if not entry.row:
        for use in dict.fromkeys(name for state in states for name in state.talks):
            yield f"- {use}: {_talk(design, design.protocol(use), entry.name)}"


def _row(row: elements.Row) -> str:
    parts = [f"if {', '.join(row.when)}"] if row.when else []
    parts += [f"say {', '.join(row.say)}"] if row.say else []
    parts += [f"may say {', '.join(row.may)}"] if row.may else []
    parts += [f"owe {', '.join(row.owes)}"] if row.owes else []
    parts += [f"let wait {', '.join(row.waits)}"] if row.waits else []
    parts += [f"drop {', '.join(row.drop)}"] if row.drop else []
    parts += [f"go on by choice {row.then}"] if row.then else []
    parts += [f"then {row.to}"] if row.to else []
    return "; ".join(parts) or "note it"


def _talk(design: Design, use: elements.Protocol, agent: str) -> str:
    peer = use.participant if use.initiator == agent else use.initiator
    hears = ", ".join(_said(design, use, message) for message in use.message if message.sender == peer)
    says = ", ".join(_said(design, use, message) for message in use.message if message.sender == agent)
    return f"{use.follows} with {peer}; hears {hears}; says {says}"


def _said(design: Design, use: elements.Protocol, message: elements.Message) -> str:
    words = " | ".join(name.partition(".")[2] for name in design.contents(use, message))
    return f"{message.performative} {words}".strip()


def openings(design: Design, agent: str) -> Iterator[tuple[str, str, Performative, str]]:
    """(peer, protocol, act, LANGUAGE.Class or "") of whatever may be asked of an agent first."""
    for use in design.file.protocol:
        table = design.tables.get(use.follows)
        if use.participant != agent or table is None:
            continue
        for message in use.message:
            if message.sender == use.initiator and message.performative in table.openings:
                for content in design.contents(use, message) or ("",):
                    yield use.initiator, use.follows, message.performative, content
