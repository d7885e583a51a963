"""`roco design verify`: the proof of a design in three layers, before anything runs; `export`: its
models for spin; `follow`: whether a run is a path of them.

Exit codes: 0 all holds, 1 something was found or is open, 2 a file cannot be read or an option
makes no sense.
"""

import textwrap
import time
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Annotated

import msgspec
import typer

from agent_runtime.io.steplog import deeds
from console import completion
from console.design import files
from console.output import Form, Format, argument, option
from operate.doing import doing
from operate.file_names import STEPS
from operate.system import of_run
from topdown.check.requirements import lost_without
from topdown.model.design import Design, load
from topdown.model.errors import NoSuchEntry
from topdown.prove import durable, volatile
from topdown.prove.engine import as_text
from topdown.prove.net import NetModel, promela
from topdown.prove.pairs import net_of
from topdown.prove.paths import Deviation, Follower
from topdown.prove.verify import (
    ABSTRACTIONS,
    LAYERS,
    NOT_PROVEN,
    Task,
    Verdict,
    died,
    tasks,
    waiting,
)

ANY = "any"
TITLES = {
    1: "Layer 1: the durable stream and physical acts, in micro-steps",
    2: "Layer 2: each use of a protocol, copies and receipts explicit",
    3: "Layer 3: all agents composed, on ideal queues",
}
ALONE_TITLE = "Layer 3: each agent among peers that send what their tables allow, on ideal queues"

FAULTS = option(
    "How many faults at most, in layers 2 and 3: 0, 1, 2 ..., or any.", complete=completion.faults
)
ONE_LAYER = option("Only this layer; may be given again.", "--layer", complete=completion.layers)
STEP = option(
    "Only the channels that this step of the design created or changed.", complete=completion.steps
)
ALL = "all"
GONE = option(
    "Besides: this agent (or each of `all`) may die for good, and wishes of persons still end.",
    complete=completion.agents,
)
SECONDS = option("CPU seconds for each verdict; what is open then is said.")
SKIP_START = option("Leave out the start of all agents (layer 3).", "--skip-start")
ALONE = option(
    "Layer 3: verify each agent by itself. The others may send whatever their tables allow.",
    "--alone",
)
LONG = option("Also what the model leaves out, and why that is safe.", "--long")


def verify(
    file: files.File = None,
    faults: Annotated[str, FAULTS] = "1",
    layer: Annotated[list[int] | None, ONE_LAYER] = None,
    step: Annotated[int | None, STEP] = None,
    gone: Annotated[list[str] | None, GONE] = None,
    seconds: Annotated[float | None, SECONDS] = None,
    skip_start: Annotated[bool, SKIP_START] = False,
    alone: Annotated[bool, ALONE] = False,
    long: Annotated[bool, LONG] = False,
    form: Form = Format.TEXT,
) -> None:
    """Prove a design: no deadlock, nothing unforeseen, every conversation ends, no act twice, no
    stale plan.

    Examples:
      roco design verify
      roco design verify --format json
    """
    with files.problems(form):
        place = files.meant(file)
        most, wanted = _most(faults), tuple(layer or LAYERS)
        design = load(place)
        dead = _gone(design, gone or [])
        if alone and gone:
            raise ValueError("--alone judges no death for good; leave out --alone or --gone")
        asked = partial(tasks, faults=most, layers=wanted, step=step, gone=dead, alone=alone)
        try:
            work = tuple(asked(design, seconds=seconds, skip_start=skip_start))
        except IndexError as error:
            raise ValueError(str(error)) from error
        if not work:
            raise ValueError(
                "nothing to prove; layers are 1, 2, 3, and a step changes channels of layer 2 only"
            )
        verdicts = _verdicts(work, form, TITLES | ({3: ALONE_TITLE} if alone else {}))
    words = summary(verdicts, files.width(), long=long)
    meant = design.agents if ALL in (gone or ()) else dead
    asked_of = meant if 3 in wanted and step is None else ()
    told = [one for name in asked_of for one in _item(_loss(design, name, verdicts), files.width())]
    if told:
        words = "\n".join(["If an agent dies for good:", *told, "", words])
    lost = {died(name): lost_without(design, name)._asdict() for name in asked_of}
    plain = [{**_plain(one), "lost": lost.get(one.what)} for one in verdicts]
    files.tell(plain, form, words)
    if not all(verdict.holds for verdict in verdicts):
        raise typer.Exit(1)


def _gone(design: Design, names: list[str]) -> tuple[str, ...]:
    """The agents that may die for good; of `all` those that leave somebody whose wish could end."""
    found: list[str] = []
    for name in names:
        if name != ALL or ALL in design.agents:
            found.append(name)
            continue
        for agent in design.agents:
            with suppress(ValueError):
                waiting(design, agent)
                found.append(agent)
    return tuple(dict.fromkeys(found))


def _loss(design: Design, agent: str, verdicts: list[Verdict]) -> str:
    """What is lost with an agent, and whether all else comes to rest."""
    loss = lost_without(design, agent)
    one = next((one for one in verdicts if one.what == died(agent)), None)
    parts = [f"{', '.join(loss.whole)} {_is(loss.whole)} lost"] if loss.whole else []
    parts += [f"{', '.join(loss.part)} {_is(loss.part)} lost in part"] if loss.part else []
    lost = ", ".join(parts) or "no requirement is lost"
    if one is None:
        rest = "persons talk to it alone, so nobody is left whose wish could end"
    elif one.holds:
        rest = "the rest holds: every wish of a person still ends"
    else:
        rest = (
            "wishes of persons may never end" if one.findings else "whether the rest holds is open"
        )
    return f"{agent}: {lost}; {rest}"


def _is(names: tuple[str, ...]) -> str:
    return "is" if len(names) == 1 else "are"


def _most(faults: str) -> int | None:
    if faults == ANY:
        return None
    if not faults.isdigit():
        raise ValueError(f"--faults {faults!r} is no number; say 0, 1, 2 or {ANY}")
    return int(faults)


def _verdicts(work: tuple[Task, ...], form: Format, titles: dict[int, str]) -> list[Verdict]:
    """Each verdict as it comes, with progress on a terminal."""
    verdicts: list[Verdict] = []
    shown = 0
    for task in work:
        if form is Format.TEXT and task.layer != shown:
            shown = task.layer
            print(titles[shown])
        with doing(task.what) as say:
            began = time.process_time()
            verdict = task.run(
                lambda states, waiting, what=task.what, began=began: say(  # type: ignore[misc]
                    f"{what}: {so_far(states, waiting, time.process_time() - began)}"
                )
            )
        verdicts.append(verdict)
        if form is Format.TEXT:
            print(line(verdict, files.width()))
    return verdicts


def so_far(states: int, waiting: int, cpu_s: float) -> str:
    """How far a search is. Nobody knows before its end how many states there are, so of what is
    left only those that wait are told.
    """
    rate = (states - waiting) / max(cpu_s, 1e-3)
    left = f", at least {waiting / rate:.0f} s more" if rate else ""
    return f"{states:,} states, {waiting:,} wait{left}; {rate:,.0f}/s, {cpu_s:.0f} s of processor"


def line(verdict: Verdict, width: int) -> str:
    """A verdict in a line, and what is wrong or open below it."""
    count = verdict.faults
    faults = "any faults" if count is None else f"{count} fault{'s' * (count != 1)}"
    word = "holds" if verdict.holds else "FAILS" if verdict.findings else "open"
    took = f"{verdict.states:>9,} states {verdict.seconds:6.1f} s{verdict.cpu_s:6.1f} s CPU"
    lines = [f"  {verdict.what:<22} {faults:<11}{took}  {word}"]
    for text in verdict.open:
        lines += textwrap.wrap(text, width, initial_indent="      ", subsequent_indent="      ")
    lines += [f"\n{as_text(finding, width)}\n" for finding in verdict.findings]
    return "\n".join(lines)


def summary(verdicts: list[Verdict], width: int, *, long: bool) -> str:
    """A summary of all verdicts, and of what none of them covers."""
    failed = sum(bool(verdict.findings) for verdict in verdicts)
    opened = sum(bool(verdict.open) for verdict in verdicts)
    states = sum(verdict.states for verdict in verdicts)
    lines = [f"{len(verdicts)} verdicts, {states:,} states: {failed} fail, {opened} open"]
    notes = [note for verdict in verdicts for note in verdict.notes]
    if notes and not long:
        lines.append(f"{len(notes)} rows or states were not needed by any path; --long lists them")
    if long:
        lines += ["", "Not needed by any path:", *(f"  {note}" for note in notes or ["nothing"])]
        lines += ["", "What the composed model leaves out, and why that is safe:"]
        for one in ABSTRACTIONS:
            lines += _item(f"{one.what}: {one.why}. Shown by: {one.shown}.", width)
        models = {"durable": durable.ABSTRACTIONS, "volatile": volatile.ABSTRACTIONS}
        for title, table in models.items():
            lines += ["", f"What the models of {title} uses leave out, and why that is safe:"]
            lines += [line for what, why in table for line in _item(f"{what}: {why}.", width)]
    lines += ["", "Not proven by any layer:"]
    beyond = dict.fromkeys(text for verdict in verdicts for text in verdict.beyond)
    for text in (*beyond, *NOT_PROVEN):
        lines += _item(text, width)
    return "\n".join(lines)


def _item(text: str, width: int) -> list[str]:
    return textwrap.wrap(f"- {text}", width, subsequent_indent="  ")


def _plain(verdict: Verdict) -> dict[str, object]:
    """A verdict for programs."""
    findings = []
    for one in verdict.findings:
        trace = [{"who": step.who, "what": step.what} for step in one.trace]
        told = {"kind": one.kind, "text": one.text, "causes": one.causes}
        findings.append({**told, "trace": trace})
    fields = {name: getattr(verdict, name) for name in verdict._fields if name != "findings"}
    kept: dict[str, object] = msgspec.to_builtins(fields)
    return {**kept, "holds": verdict.holds, "findings": findings}


# --- `roco design export`: the uses of protocols as models for spin (Promela) ---------------------


PROMELA = option("Write Promela for spin here: a file for one use, a folder for more.", "--promela")
USE = option("A use of a protocol by name; may be given again.", "--use", complete=completion.uses)
PAIR = option("Two agents with - between: all uses between them.", complete=completion.pairs)
IDEAL = option("Durable uses over ideal queues, without copies and receipts.", "--ideal")


LOOK_WITH = "spin -a -o1 -o2 FILE && gcc -O2 -DSAFETY -DNOREDUCE -o pan pan.c && ./pan -m1000000"


class Written(msgspec.Struct, frozen=True):
    """A file, and the size of what is in it; `look_with`: the command by which its tool takes
    it.
    """

    use: str
    file: str
    variables: int
    queues: int
    commands: int
    look_with: str


def export(
    file: files.File = None,
    to: Annotated[Path | None, PROMELA] = None,
    use: Annotated[list[str] | None, USE] = None,
    pair: Annotated[str | None, PAIR] = None,
    faults: Annotated[int, option("How many faults at most.", min=0)] = 0,
    ideal: Annotated[bool, IDEAL] = False,
    form: Form = Format.TEXT,
) -> None:
    """Write the models of a design's protocols for spin (Promela).

    Examples:
      roco design export --promela plan.pml --use execute_plan
      roco design export --promela models --pair AGENT-PEER
    """
    with files.problems(form):
        place = files.meant(file)
        if to is None:
            raise ValueError("nothing to write; name a file or a folder with --promela")
        design = load(place)
        names = _uses(design, use or [], pair)
        one_file = len(names) == 1 and bool(to.suffix) and not to.is_dir()
        written = []
        for name in names:
            net = net_of(design, name, faults, ideal=ideal)
            NetModel(net)  # names are checked before anything is written
            where = to if one_file else to / f"{name}.pml"
            where.parent.mkdir(parents=True, exist_ok=True)
            where.write_text(promela(net), encoding="utf-8")
            sizes = len(net.variables), len(net.queues), len(net.commands)
            look_with = LOOK_WITH.replace("FILE", str(where))
            written.append(Written(net.name, str(where), *sizes, look_with))
    lines = [
        f"wrote {one.file}: {one.use}, {one.variables} variables,"
        f"{f' {one.queues} queues,' if one.queues else ''} {one.commands} commands"
        for one in written
    ]
    lines += dict.fromkeys(f"  {one.look_with}" for one in written)
    files.tell(written, form, "\n".join(lines))


def _uses(design: Design, named: list[str], pair: str | None) -> list[str]:
    """The uses that are meant; all where none is named. Raises NoSuchEntry, ValueError."""
    names = [design.protocol(name).name for name in named]
    if pair is not None:
        ends = set(pair.split("-"))
        if len(ends) != 2:
            raise ValueError(f"--pair {pair!r} is no pair; write two agents with - between")
        found = [
            use.name for use in design.file.protocol if {use.initiator, use.participant} == ends
        ]
        if not found:
            pairs = (f"{use.initiator}-{use.participant}" for use in design.file.protocol)
            raise NoSuchEntry("pair with a protocol", pair, pairs)
        names += found
    known = [use.name for use in design.file.protocol if use.follows in design.tables]
    return list(dict.fromkeys(names)) or known


# --- `roco design follow`: whether what agents of a run did is a path of the proven model ---------


Run = Annotated[Path, argument("A run's folder; its agents' steps are in RUN/steps.", exists=True)]
DesignFile = Annotated[
    Path | None, option("A design file; else that of the run's system.", "--design")
]


def follow(run: Run, design: DesignFile = None, form: Form = Format.TEXT) -> None:
    """Follow a run through the composed model of its design: every step of every agent must be a
    move of it.

    Examples:
      roco design follow runs/latest
    """
    with files.problems(form):
        done = deeds(run / STEPS)
        if not done:
            raise ValueError(
                f"{run / STEPS} has no steps; name the folder of a run, as `roco up` or `roco demo`"
                " wrote it"
            )
        follower = Follower(of_run(run).design if design is None else load(design))
        found = follower.follow(done)
    files.tell(
        {"steps": follower.count, "deviation": found and found._asdict()},
        form,
        _progress_text(follower, found),
    )
    if found is not None:
        raise typer.Exit(1)


def _progress_text(follower: Follower, found: Deviation | None) -> str:
    if found is None:
        return (
            f"{follower.count} steps, each a move of the model (at most {follower.most} of its"
            " states at a time)"
        )
    lines = [
        f"step {found.number} is no move of the model: {found.agent} {found.what}",
        "the model would be at",
    ]
    return "\n".join(lines + [f"  {agent:<4} {words}" for agent, words in found.here.items()])
