"""`roco send`: a person is an agent. Says one communicate to a running fleet and prints what comes back.

In the place of an agent that does not run it is a life of that agent, with its journal and its numbers. Beside one that
lives it refuses, and with --force is a voice in its name: whoever hears cannot tell, and streams may break.
"""

import subprocess
import time
from typing import TYPE_CHECKING, Annotated, cast

import msgspec
import typer
from rich.table import Table
from rich.text import Text

from agent_runtime.core.errors import RuntimeFault
from fipa_codec.communicate import Communicate, encode_strictly
from fipa_codec.errors import FipaError
from fipa_codec.performatives import Performative
from operate.cli import completion
from operate.cli.errors import NO, ConsoleError
from operate.cli.fleet import targets
from operate.cli.fleet.local import Local
from operate.cli.output import Form, Format, RunDir, problems, tell_problem
from operate.cli.terminal.console import Console
from operate.cli.traffic import speak
from operate.cli.traffic.conversation import names as conversation_names
from operate.system import System
from topdown.judge.admission import Admission
from topdown.model.design import Design, Rule

if TYPE_CHECKING:
    from operate.cli.fleet.compose import Compose

CHOICES = ("as", "to", "protocol", "performative")


class Usage(Exception):
    """The design does not have what was asked for; the message says what it has."""


def send(
    sender: Annotated[str, typer.Option("--as", help="The agent you are.", autocompletion=completion.agents)] = "",
    receiver: Annotated[
        str, typer.Option("--to", help="The agent you talk to.", autocompletion=completion.agents)
    ] = "",
    protocol: Annotated[
        str,
        typer.Option(help="The protocol, as the design names what it follows.", autocompletion=completion.protocols),
    ] = "",
    performative: Annotated[str, typer.Option(help="The act.", autocompletion=completion.performatives)] = "",
    language: Annotated[
        str, typer.Option(help="The content's language; else the design's.", autocompletion=completion.languages)
    ] = "",
    ontology: Annotated[
        str | None, typer.Option(help="The ontology; else the design's.", autocompletion=completion.ontologies)
    ] = None,
    content: Annotated[str, typer.Option(help="""The content as JSON, such as '{"type":"Done"}'.""")] = "",
    conversation: Annotated[
        str, typer.Option(help="The conversation to go on with; else a new one.", autocompletion=conversation_names)
    ] = "",
    in_reply_to: Annotated[str, typer.Option(help="The m_w of what this answers.")] = "",
    reply_with: Annotated[str, typer.Option(help="The m_w of this one; else the id, where an answer names it.")] = "",
    reply_by: Annotated[float | None, typer.Option(help="Seconds from now until which an answer is wanted.")] = None,
    wait: Annotated[float, typer.Option(help="Seconds to listen for what comes back.")] = 5.0,
    id: Annotated[str, typer.Option(help="With --force beside a living agent: the message's id.")] = "",
    force: Annotated[
        bool, typer.Option("--force", help="Say it though the design forbids it, or the agent lives.")
    ] = False,
    choices: Annotated[bool, typer.Option("--list", help="List what may be said, as far as it is chosen.")] = False,
    target: targets.Name = "",
    run_dir: RunDir = None,
    form: Form = Format.TEXT,
) -> None:
    """Be an agent: say one communicate to the running fleet, and print what comes back.

    Of a fleet in containers it is said in a container of its own beside the agent's. Exits with 1 where it could not be
    said, with 2 where the design has no such message (--force says it all the same).

    Examples:
      roco send --list
      roco send --list --as AGENT --to PEER
      roco send --as AGENT --to PEER --protocol request --list
    """
    chosen = (sender, receiver, protocol, performative)
    with problems(form):
        system = targets.about(target, run_dir)
    if choices or not all(chosen):
        _list(system.design, chosen, form, missing=not choices)
        return
    try:
        draft = _draft(system, chosen, language, ontology, content, force=force)
        fleet = targets.find(target, run_dir)
        if not isinstance(fleet, Local):
            told: dict[str, object] = dict(zip(CHOICES, chosen, strict=True))
            told |= {"language": language, "content": content, "id": id}
            told |= {"conversation": conversation, "in-reply-to": in_reply_to, "reply-with": reply_with}
            told |= {"ontology": ontology or "", "reply-by": reply_by or "", "wait": wait, "format": form.value}
            raise typer.Exit(_beside(cast("Compose", fleet), sender, told, force=force))
        draft = msgspec.structs.replace(
            draft,
            conversation=conversation,
            in_reply_to=in_reply_to,
            reply_with=reply_with,
            reply_by=None if reply_by is None else time.time() + reply_by,
            id=id,
        )
        done = speak.say(system, fleet.run, draft, wait, _print if form is Format.TEXT else _hush, force=force)
    except Usage as error:
        _stop(str(error), form, 2)
    except (ConsoleError, RuntimeFault, FipaError) as error:
        _stop(str(error), form, error.code if isinstance(error, ConsoleError) else NO)
    else:
        print(msgspec.json.encode(done).decode() if form is Format.JSON else speak.outcome(done))


def _beside(fleet: "Compose", sender: str, told: dict[str, object], *, force: bool) -> int:
    """The same verb where the agent's journal and keys are; its exit code."""
    words = [f"--{name}={value}" for name, value in told.items() if value != ""] + ["--force"] * force
    return subprocess.run(fleet.beside(sender, ["operate.cli", "send", *words]), check=False).returncode


# --- what may be said -------------------------------------------------------------------------------------------------


def rules(design: Design, chosen: tuple[str, ...]) -> list[Rule]:
    """The messages of the design that fit what is chosen so far; "" fits all."""
    return [
        rule
        for rule in design.rules.values()
        if all(
            want in ("", have)
            for want, have in zip(chosen, (rule.sender, rule.receiver, rule.protocol, rule.performative), strict=True)
        )
    ]


def table(found: list[Rule]) -> Table:
    """Return the permitted communicates as a table for people."""
    drawn = Table(box=None, padding=(0, 2, 0, 0), header_style="dim")
    for name in ("as", "to", "protocol", "performative", "on"):
        drawn.add_column(name, no_wrap=True)
    drawn.add_column("content")
    drawn.add_column("at most", justify="right", no_wrap=True)
    for rule in sorted(found, key=lambda one: (one.sender, one.receiver, one.protocol, one.performative)):
        content = ", ".join(rule.contents) or f"none ({rule.language})"
        drawn.add_row(
            rule.sender, rule.receiver, rule.protocol, rule.performative, rule.channel, content, f"{rule.bytes} B"
        )
    return drawn


def _list(design: Design, chosen: tuple[str, ...], form: Format, *, missing: bool) -> None:
    found = rules(design, chosen)
    names = [name for name, value in zip(CHOICES, chosen, strict=True) if not value]
    if form is Format.JSON:
        print(msgspec.json.encode(found).decode())
    elif found:
        Console().print(table(found))
    if not found:
        _stop(_unknown(design, chosen), form, 2)
    if missing:
        _stop(f"choose --{', --'.join(names)} from what the design has (above)", form, 2)


def _unknown(design: Design, chosen: tuple[str, ...]) -> str:
    """The first choice that leaves nothing, and what would be left."""
    for count in range(1, len(chosen) + 1):
        if not rules(design, (*chosen[:count], *("",) * (len(chosen) - count))):
            before = rules(design, (*chosen[: count - 1], *("",) * (len(chosen) - count + 1)))
            have = sorted({(r.sender, r.receiver, r.protocol, str(r.performative))[count - 1] for r in before})
            return f"the design has no --{CHOICES[count - 1]} {chosen[count - 1]!r} here; it has {', '.join(have)}"
    return "the design has no such message"


def _draft(
    system: System, chosen: tuple[str, ...], language: str, ontology: str | None, content: str, *, force: bool
) -> Communicate:
    """The communicate as far as it is known before it is numbered. Raises Usage."""
    sender, receiver, protocol, act = chosen
    design, found = system.design, rules(system.design, chosen)
    if not found and not force:
        raise Usage(_unknown(design, chosen))
    rule = found[0] if found else None
    if act not in list(Performative):
        raise Usage(f"{act!r} is no performative; there are {', '.join(Performative)}")
    written = language or (rule.language if rule else "")
    about = ontology if ontology is not None else (rule.ontology if rule else "")
    try:
        draft = Communicate(
            performative=Performative(act),
            content=msgspec.UNSET if not content else msgspec.Raw(msgspec.msgpack.encode(msgspec.json.decode(content))),
            language=written,
            ontology=about,
            protocol=protocol,
            sender=sender,
            receiver=receiver,
        )
    except msgspec.DecodeError as error:
        raise Usage(f"--content is no JSON: {error}") from error
    if rule is not None and not force:
        size = len(encode_strictly(draft))
        faults = Admission(design, system.languages).check(design.key("any", draft), draft, size).faults
        if faults:
            raise Usage("; ".join(fault.why for fault in faults) + "; --force says it all the same")
    return draft


def _hush(what: str, one: Communicate, size: int) -> None:
    """For programs all of it comes at once."""


def _print(what: str, one: Communicate, size: int) -> None:
    console = Console()
    way = f"  {one.sender} > {one.receiver}  {one.performative}  "
    console.print(Text.assemble((what, "bold"), way, (f"{size} B", "dim")))
    line = f"  conversation {one.conversation}  id {one.id}"
    console.print(line + (f"  in reply to {one.in_reply_to}" if one.in_reply_to else ""), style="dim", highlight=False)
    if one.content is not msgspec.UNSET:
        text = msgspec.json.encode(msgspec.msgpack.decode(one.content)).decode()
        console.print(f"  {one.language} {text}", highlight=False, soft_wrap=True)


def _stop(text: str, form: Format, code: int) -> None:
    tell_problem(text, form)
    raise typer.Exit(code)
