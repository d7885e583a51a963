"""`roco send`: a person is an agent. Says one communicate to a running fleet and prints what comes
back.

In the place of an agent that does not run it is a life of that agent, with its journal and its
numbers. Beside one that lives it refuses, and with --force is a voice in its name: whoever hears
cannot tell, and streams may break.
"""

import os
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, cast

import msgspec
import typer
from rich.table import Table
from rich.text import Text

from agent_runtime.core.binding import wiring
from agent_runtime.core.errors import JournalError, RuntimeFault
from agent_runtime.impersonation import StandIn, StandInError, Voice
from agent_runtime.io.options import LISTEN_VARIABLE, Options
from agent_runtime.io.sessions import Links, NoEndpointError
from console import completion
from console.errors import ConsoleError, NoRunError, UsageError
from console.fleet import identity, targets
from console.fleet.local import Local
from console.output import Form, Format, RunDir, option, tell
from console.runs import folders
from console.terminal.console import Console, table
from console.traffic.listen import fields_of
from console.traffic.listen import names as conversation_names
from fipa_codec.communicate import Communicate, encode, encode_strictly
from fipa_codec.errors import FipaError
from fipa_codec.languages import Kind, Languages
from fipa_codec.performatives import Performative
from fipa_codec.tables import Role
from operate.fleet_file import Fleet
from operate.system import System
from topdown.judge.follow import Followed
from topdown.judge.verdicts import Admission
from topdown.model.design import Design, Rule

if TYPE_CHECKING:
    from console.fleet.compose import Compose

# --- Saying one communicate to a running fleet, as an agent that does not run or in the name of one
# that does
# Whoever calls gives what is to be said and is told what was said and heard, as it comes.


RECEIPT_S = 2.0
"""Time to wait for a receipt [s]: one takes milliseconds, a peer restarted just now a second
(estimate).
"""
NO_CHANNEL = "none"
"""Stands in the key of what is forced between agents that no channel joins."""
Tell = Callable[[str, Communicate, int], None]


class Sending(msgspec.Struct, frozen=True):
    """A sent communicate and the replies. `receipted` None: nobody receipts such a message.

    `ended`: the conversation it opened has ended.
    """

    sent: dict[str, Any]
    size: int
    receipted: bool | None
    ended: bool
    heard: tuple[dict[str, Any], ...]


def say(
    system: System, run: Path, draft: Communicate, wait_s: float, tell: Tell, *, force: bool
) -> Sending:
    """Say it, and listen until its conversation has ended or `wait_s` is over.

    Raises ConsoleError where no fleet runs, or the agent does and nothing is forced.
    """
    fleet = folders.living(run) or folders.around()
    if fleet is None:
        raise NoRunError(str(run), f"no fleet was started in {run}; `roco up` starts one")
    rule = (draft.sender, draft.receiver, draft.protocol, draft.performative)
    if not rules(system.design, rule):
        return _voiced(system, run, fleet, draft, wait_s, tell)
    try:
        first = system.design.agent(draft.sender).initial
        languages = system.languages or Languages()
        wires = wiring(draft.sender, fleet.system, design=system.design, languages=languages)
        tls = identity.tls(run, fleet, draft.sender)
        keys = identity.folder(run, fleet)
        here = os.environ.get(LISTEN_VARIABLE, "")  # in a container
        links = Links(Options(keys=keys, agents=fleet.agents, listen=here), wires)
        life = StandIn(wires, first, run, links, router=fleet.connect, tls=tls)
    except NoEndpointError as error:
        raise ConsoleError(str(error)) from error
    except (StandInError, JournalError) as error:
        if force:
            return _voiced(system, run, fleet, draft, wait_s, tell)
        raise ConsoleError(_refusal(draft.sender, error)) from error
    try:
        return _lived(system, life, draft, wait_s, tell)
    finally:
        life.close()


def outcome(done: Sending) -> str:
    """Return the outcome in a sentence."""
    to, me = done.sent["receiver"], done.sent["sender"]
    if done.receipted is False:
        return (
            f"not receipted by {to}: it is kept in the journal, and the next life of {me} sends it"
            " again"
        )
    receipted = f"receipted by {to}; " if done.receipted else ""
    if done.ended:
        return f"{receipted}the conversation has ended"
    return receipted + ("nothing came back" if not done.heard else f"{len(done.heard)} came back")


def _refusal(agent: str, error: RuntimeFault) -> str:
    if isinstance(error, StandInError) and not error.lives:
        return f"{error}; is the fleet up? (`roco status`)"
    return (
        f"{agent} runs ({error}), and its streams are numbered: a message in its place would take a"
        " number that it will use. Leave it out (`roco up --only ...`), or say it with --force,"
        " which may confuse its peers"
    )


def _lived(system: System, life: StandIn, draft: Communicate, wait_s: float, tell: Tell) -> Sending:
    """As the agent itself would."""
    table, rule = system.design.tables[draft.protocol], system.design.rule(draft)
    labelled = draft.performative in table.openings | table.confirmed | {Performative.CANCEL}
    named = draft.conversation or life.name()
    one = life.say(msgspec.structs.replace(draft, conversation=named, id=""), labelled=labelled)
    tell("said", one, len(encode(one)))
    talk = Watched(system, one, new=not draft.conversation and draft.performative in table.openings)
    heard: list[Communicate] = []
    until = time.time() + wait_s
    for answer in life.hear(until):
        heard.append(answer)
        tell("heard", answer, len(encode(answer)))
        if talk.ended_by(answer):
            break
    if rule.durable and life.unreceipted(one.receiver) and wait_s < RECEIPT_S:
        heard += life.hear(time.time() + RECEIPT_S, unless_receipted=one.receiver)
    receipted = life.unreceipted(one.receiver) == 0 if rule.durable else None
    return _sending(one, receipted, talk.ended, heard)


def _voiced(
    system: System, run: Path, fleet: Fleet, draft: Communicate, wait_s: float, tell: Tell
) -> Sending:
    """In the name of an agent that lives, or as no agent could: on its key, without number, token
    or receipt.

    Where there are keys, router or receiver takes only what the design lets the sender say.
    """
    design = system.design
    template = design.file.system.key
    names = ("channel", "sender", "receiver", "protocol", "performative")
    ears = dict.fromkeys(names, "*") | {"system": fleet.system, "receiver": draft.sender}
    stamp = f"forced-{time.time_ns() // 1_000_000:x}"
    id = draft.id or stamp
    label, named = draft.reply_with or id, draft.conversation or stamp
    one = msgspec.structs.replace(
        draft, id=id, conversation=named, reply_with=label, sent=time.time()
    )
    channels = design.peers(draft.sender) if draft.sender in design.agents else {}
    said = {name: str(getattr(one, name)) for name in names[1:]}
    channel = channels.get(draft.receiver, NO_CHANNEL)
    key = template.format(system=fleet.system, channel=channel, **said)
    at = fleet.agents.get(draft.receiver, fleet.connect)
    voice = Voice(at, (template.format(**ears),), tls=identity.tls(run, fleet, draft.sender))
    heard: list[Communicate] = []
    try:
        tell("said by force", one, voice.put(key, one))
        for answer in voice.hear(time.time() + wait_s):
            if answer.conversation == one.conversation:
                heard.append(answer)
                tell("heard", answer, len(encode(answer)))
    finally:
        voice.close()
    return _sending(one, None, False, heard)


class Watched:
    """Whether the conversation that a message opened has ended; others are not known here."""

    def __init__(self, system: System, opening: Communicate, *, new: bool) -> None:
        self.ended = False
        self._languages = system.languages or Languages()
        self._opening = opening
        self._followed = (
            Followed(system.design.tables[opening.protocol], durable=True) if new else None
        )
        self._take(Role.INITIATOR, opening)

    def ended_by(self, one: Communicate) -> bool:
        """Whether it is over with this message."""
        if one.conversation == self._opening.conversation and one.sender == self._opening.receiver:
            self._take(Role.PARTICIPANT, one)
        return self.ended

    def _take(self, role: Role, one: Communicate) -> None:
        if self._followed is None:
            return
        try:
            kind = self._languages.read(one)[1]
        except FipaError:
            kind = Kind.PLAIN
        said = self._followed.read(role, one.performative, one.reply_with, one.in_reply_to, (kind,))
        if not isinstance(said, str):
            self._followed.take(role, said)
        self.ended = self._followed.sides[Role.INITIATOR].ended


def _sending(
    one: Communicate, receipted: bool | None, ended: bool, heard: list[Communicate]
) -> Sending:
    return Sending(_fields(one), len(encode(one)), receipted, ended, tuple(map(_fields, heard)))


def _fields(one: Communicate) -> dict[str, Any]:
    told = fields_of(one)
    return {name: told[name] for name in one.__struct_fields__ if told.get(name) not in ("", None)}


# --- `roco send` ----------------------------------------------------------------------------------


CHOICES = ("as", "to", "protocol", "performative")


def send(
    sender: Annotated[str, option("The agent you are.", "--as", complete=completion.agents)] = "",
    receiver: Annotated[
        str, option("The agent you talk to.", "--to", complete=completion.agents)
    ] = "",
    protocol: Annotated[
        str,
        option("The protocol, as the design names what it follows.", complete=completion.protocols),
    ] = "",
    performative: Annotated[str, option("The act.", complete=completion.performatives)] = "",
    language: Annotated[
        str, option("The content's language; else the design's.", complete=completion.languages)
    ] = "",
    ontology: Annotated[
        str | None, option("The ontology; else the design's.", complete=completion.ontologies)
    ] = None,
    content: Annotated[str, option("""The content as JSON, such as '{"type":"Done"}'.""")] = "",
    conversation: Annotated[
        str, option("The conversation to go on with; else a new one.", complete=conversation_names)
    ] = "",
    in_reply_to: Annotated[str, option("The m_w of what this answers.")] = "",
    reply_with: Annotated[
        str, option("The m_w of this one; else the id, where an answer names it.")
    ] = "",
    reply_by: Annotated[
        float | None, option("Seconds from now until which an answer is wanted.")
    ] = None,
    wait: Annotated[float, option("Seconds to listen for what comes back.")] = 5.0,
    id: Annotated[str, option("With --force beside a living agent: the message's id.")] = "",
    force: Annotated[
        bool, option("Say it though the design forbids it, or the agent lives.", "--force")
    ] = False,
    choices: Annotated[
        bool, option("List what may be said, as far as it is chosen.", "--list")
    ] = False,
    target: targets.Name = "",
    run_dir: RunDir = None,
    form: Form = Format.TEXT,
) -> None:
    """Send one communicate as an agent, and print the replies.

    Of a fleet in containers it is said in a container of its own beside the agent's. Exits with 1
    where it could not be said, with 2 where the design has no such message (--force says it all the
    same).

    Examples:
      roco send --list
      roco send --list --as AGENT --to PEER
      roco send --as AGENT --to PEER --protocol request --list
    """
    chosen = (sender, receiver, protocol, performative)
    with _refusals():
        system = targets.about(target, run_dir)
        if choices or not all(chosen):
            _list(system.design, chosen, form, missing=not choices)
            return
        draft = _draft(system, chosen, language, ontology, content, force=force)
        fleet = targets.find(target, run_dir)
        if not isinstance(fleet, Local):
            given: dict[str, object] = dict(zip(CHOICES, chosen, strict=True))
            given |= {"language": language, "ontology": ontology, "content": content, "id": id}
            given |= {"conversation": conversation, "in-reply-to": in_reply_to}
            given |= {"reply-with": reply_with, "reply-by": reply_by}
            given |= {"wait": wait, "format": form.value}
            raise typer.Exit(_beside(cast("Compose", fleet), sender, given, force=force))
        draft = msgspec.structs.replace(
            draft,
            conversation=conversation,
            in_reply_to=in_reply_to,
            reply_with=reply_with,
            reply_by=None if reply_by is None else time.time() + reply_by,
            id=id,
        )
        heard = _print if form is Format.TEXT else lambda *_: None
        done = say(system, fleet.run, draft, wait, heard, force=force)
        tell(done, form, outcome(done))


@contextmanager
def _refusals() -> Iterator[None]:
    """What agent_runtime and fipa_codec refuse, as an error of the command line."""
    try:
        yield
    except (RuntimeFault, FipaError) as error:
        raise ConsoleError(str(error)) from error


def _beside(fleet: "Compose", sender: str, given: dict[str, object], *, force: bool) -> int:
    """The same verb where the agent's journal and keys are; its exit code."""
    words = [f"--{name}={value}" for name, value in given.items() if value not in ("", None)]
    words += ["--force"] * force
    return subprocess.run(fleet.beside(sender, ["console", "send", *words])).returncode


# --- what may be said -----------------------------------------------------------------------------


def rules(design: Design, chosen: tuple[str, ...]) -> list[Rule]:
    """The messages between agents that fit what is chosen so far; "" fits all."""
    return [
        rule
        for rule in design.rules.values()
        if rule.use not in design.guest_uses
        and all(want in ("", have) for want, have in zip(chosen, _names(rule), strict=True))
    ]


def _names(rule: Rule) -> tuple[str, ...]:
    """Return the names by which a message is chosen, in the order of CHOICES."""
    return rule.sender, rule.receiver, rule.protocol, rule.performative


def allowed(found: list[Rule]) -> Table:
    """Return the permitted communicates as a table for people."""
    drawn = table((*CHOICES, "on", "content", "at most"), right=("at most",), fold=("content",))
    for one in sorted(found, key=_names):
        content = ", ".join(one.contents) or f"none ({one.language})"
        drawn.add_row(*_names(one), one.channel, content, f"{one.bytes} B")
    return drawn


def _list(design: Design, chosen: tuple[str, ...], form: Format, *, missing: bool) -> None:
    found = rules(design, chosen)
    names = [name for name, value in zip(CHOICES, chosen, strict=True) if not value]
    if found or form is Format.JSON:
        tell(found, form, lambda: Console().print(allowed(found)))
    if not found:
        raise UsageError(_unknown(design, chosen))
    if missing:
        raise UsageError(f"choose --{', --'.join(names)} from what the design has (above)")


def _unknown(design: Design, chosen: tuple[str, ...]) -> str:
    """The first choice that leaves nothing, and what would be left."""
    fitting = rules(design, ("",) * len(CHOICES))
    for place, (name, wanted) in enumerate(zip(CHOICES, chosen, strict=True)):
        have = {str(_names(rule)[place]) for rule in fitting}
        fitting = [rule for rule in fitting if wanted in ("", _names(rule)[place])]
        if not fitting:
            there = ", ".join(sorted(have))
            return f"the design has no --{name} {wanted!r} here; it has {there}"
    return "the design has no such message"


def _draft(
    system: System,
    chosen: tuple[str, ...],
    language: str,
    ontology: str | None,
    content: str,
    *,
    force: bool,
) -> Communicate:
    """The communicate as far as it is known before it is numbered. Raises UsageError."""
    sender, receiver, protocol, act = chosen
    design, found = system.design, rules(system.design, chosen)
    if not found and not force:
        raise UsageError(_unknown(design, chosen))
    rule = found[0] if found else None
    if act not in list(Performative):
        raise UsageError(f"{act!r} is no performative; there are {', '.join(Performative)}")
    try:
        packed = msgspec.msgpack.encode(msgspec.json.decode(content)) if content else b""
    except msgspec.DecodeError as error:
        raise UsageError(f"--content is no JSON: {error}") from error
    draft = Communicate(
        performative=Performative(act),
        content=msgspec.Raw(packed) if content else msgspec.UNSET,
        language=language or (rule.language if rule else ""),
        ontology=ontology if ontology is not None else (rule.ontology if rule else ""),
        protocol=protocol,
        sender=sender,
        receiver=receiver,
    )
    if rule is not None and not force:
        key, size = design.key("any", draft), len(encode_strictly(draft))
        faults = Admission(design, system.languages).check(key, draft, size).faults
        if faults:
            raise UsageError(
                "; ".join(fault.why for fault in faults) + "; --force says it all the same"
            )
    return draft


def _print(what: str, one: Communicate, size: int) -> None:
    console = Console()
    way = f"  {one.sender} > {one.receiver}  {one.performative}  "
    console.print(Text.assemble((what, "bold"), way, (f"{size} B", "dim")))
    line = f"  conversation {one.conversation}  id {one.id}"
    line += f"  in reply to {one.in_reply_to}" if one.in_reply_to else ""
    console.print(line, style="dim", highlight=False)
    if one.content is not msgspec.UNSET:
        text = msgspec.json.encode(msgspec.msgpack.decode(one.content)).decode()
        console.print(f"  {one.language} {text}", highlight=False, soft_wrap=True)
