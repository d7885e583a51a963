"""Names for the shell to complete: runs, and what a design has.

Nothing of a project is imported: its design is read as a file (operate.system.design_shown). Names
that only a running fleet knows are in console.fleet.targets. A completer gets the options that
stand before the word, so that names are those of the design file or of the run that was named
there.
"""

from collections.abc import Callable, Iterable
from pathlib import Path

import typer

from operate.system import NoSystemError, design_shown, here
from operate.wording import escaped, one_line
from topdown.model.design import Design, load
from topdown.model.errors import TopdownError

RUNS = Path("runs")
NAMING = ("file", "design", "run", "recording", "run_dir")
"""Parameters that name a design file or a run."""
LEVEL = "log-level"
"""What every agent has beside the parameters of its design."""
KINDS = ("channel", "agent", "protocol", "performative")
"""Kinds that `roco replay --only KIND=NAME` can choose by."""


def among(names: Iterable[str], incomplete: str) -> list[str]:
    """What begins so; not what a terminal would obey where the shell shows it."""
    return [
        str(name)
        for name in names
        if name.startswith(incomplete) and one_line(escaped(name)) == name
    ]


def _of_design(
    names: Callable[[Design], Iterable[str]],
) -> Callable[[typer.Context, str], list[str]]:
    """A completer of names that a design has."""

    def completer(ctx: typer.Context, incomplete: str) -> list[str]:
        return [name for design in _designs(ctx) for name in among(names(design), incomplete)]

    return completer


agents = _of_design(lambda design: design.agents)
guests = _of_design(lambda design: design.guests)
channels = _of_design(lambda design: design.channels)
protocols = _of_design(lambda design: design.tables)  # as it names what it follows
uses = _of_design(lambda design: design.protocols)
pairs = _of_design(lambda design: ["-".join(one.ends) for one in design.channels.values()])
steps = _of_design(lambda design: map(str, range(1, len(design.file.step) + 1)))
ontologies = _of_design(
    lambda design: dict.fromkeys(use.ontology for use in design.file.protocol if use.ontology)
)
languages = _of_design(lambda design: [one.name for one in design.file.language])
systems = _of_design(lambda design: [design.file.system.name])
moments = _of_design(
    lambda design: [
        f"{agent}:{one.name}" for agent, entry in design.agents.items() for one in entry.state
    ]
)


def _fixed(*words: str) -> Callable[[str], list[str]]:
    """A completer of values as one may write them."""
    return lambda incomplete: among(words, incomplete)


ages = _fixed("12h", "1d", "7d", "4w")
times = _fixed("30s", "5m", "1h")
speeds = _fixed("1", "2", "10", "max")
thresholds = _fixed("success=", "latency=", "energy=", "traffic=")
faults = _fixed("any", "0", "1", "2", "3")
layers = _fixed("1", "2", "3")


def runs(incomplete: str) -> list[str]:
    """The folders of runs, newest first."""
    found = [path for path in RUNS.glob("*") if path.is_dir()]
    return among(map(str, sorted(found, reverse=True)), incomplete)


def run_names(incomplete: str) -> list[str]:
    """Return the names of runs in runs/, newest first."""
    return among([Path(path).name for path in runs("")], incomplete)


def every_protocol(ctx: typer.Context, incomplete: str) -> list[str]:
    """Return the protocols that a design can follow, by every name: its own, then all that are
    registered.
    """
    from fipa_codec.tables import known

    own = [name for design in _designs(ctx) for name in design.own_tables]
    names = [name for protocol in known() for name in (protocol.name, *protocol.aliases)]
    return among(dict.fromkeys([*own, *sorted(names)]), incomplete)


def protocols_and_uses(ctx: typer.Context, incomplete: str) -> list[str]:
    """Return both: a use by its name, or all of a protocol."""
    return [*protocols(ctx, incomplete), *uses(ctx, incomplete)]


def parameters(ctx: typer.Context, incomplete: str) -> list[str]:
    """The parameters of the agent that was named before; else of all agents."""
    agent = ctx.params.get("agent")
    agents = [pair for design in _designs(ctx) for pair in design.agents.items()]
    every = [one for name, one in agents if agent in (None, name)]
    names = [parameter.name for one in every for parameter in one.parameter]
    return among([*names, LEVEL], incomplete)


def parameter_values(ctx: typer.Context, incomplete: str) -> list[str]:
    """The choices of the parameter that was named before, and its default."""
    agent, name = ctx.params.get("agent"), ctx.params.get("name")
    if name == LEVEL:
        from agent_runtime.core.control import LEVELS

        return among(LEVELS, incomplete)
    every = [design.agents[agent] for design in _designs(ctx) if agent in design.agents]
    named = [one for entry in every for one in entry.parameter if one.name == name]
    return among([str(value) for one in named for value in (*one.choices, one.default)], incomplete)


def performatives(incomplete: str) -> list[str]:
    """All performatives of FIPA."""
    from fipa_codec.performatives import Performative

    return among(Performative, incomplete)


def choices(ctx: typer.Context, incomplete: str) -> list[str]:
    """Return KIND=NAME[,NAME] as `roco replay --only` takes it: first the kinds, then the names of
    one.
    """
    kind, given, names = incomplete.partition("=")
    if not given:
        return among([f"{one}=" for one in KINDS], incomplete)
    named = {"channel": channels, "agent": agents, "protocol": protocols}
    done, comma, last = names.rpartition(",")
    if kind not in KINDS:
        return []
    found = named[kind](ctx, last) if kind in named else performatives(last)
    return [f"{kind}={done}{comma}{name}" for name in found]


def started(incomplete: str) -> list[str]:
    """Return names of processes of the system here as `roco up --only` takes them, behind the
    commas so far.
    """
    try:
        names = [one.name for one in here().processes]
    except (NoSystemError, TopdownError):
        return []
    return behind_commas(names, incomplete)


def behind_commas(names: Iterable[str], incomplete: str) -> list[str]:
    """Return the names that go on what is behind the last comma, behind all before it."""
    done, comma, last = incomplete.rpartition(",")
    return [f"{done}{comma}{name}" for name in among(names, last) if name not in done.split(",")]


def targets(incomplete: str) -> list[str]:
    """Return the values of --target: its fixed words, running compose projects, run folders."""
    from console.fleet.compose import projects

    return among(("local", "compose", *projects()), incomplete) + runs(incomplete)


def path_given(ctx: typer.Context, name: str) -> Path | None:
    """Return the path that a parameter before the word has, which is still a text there; None: it
    has none.

    Before an option without its value, arguments are not put to their names yet: they are left
    over, in order.
    """
    arguments = [one.name for one in ctx.command.params if one.param_type_name == "argument"]
    left = dict(zip(arguments, ctx.args, strict=False))
    value = ctx.params.get(name) or left.get(name)
    return Path(value) if isinstance(value, str | Path) and str(value) else None


def _designs(ctx: typer.Context) -> Iterable[Design]:
    """The design that the options name, else that of the system here; none where it cannot be
    read.
    """
    named = next((path for name in NAMING if (path := path_given(ctx, name)) is not None), None)
    try:
        if named is not None and named.suffix == ".toml":
            return (load(named),)
        return (design_shown(named),)
    except (NoSystemError, TopdownError, OSError):
        return ()
