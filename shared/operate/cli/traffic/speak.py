"""Saying one communicate to a running fleet, as an agent that does not run or in the name of one that does.

Whoever calls gives what is to be said and is told what was said and heard, as it comes.
"""

import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec

from agent_runtime.core.binding import wiring
from agent_runtime.core.errors import JournalError, RuntimeFault
from agent_runtime.io.links import Links, NoEndpointError
from agent_runtime.io.options import LISTEN_VARIABLE, Options
from agent_runtime.testing.stand_in import StandIn, StandInError, Voice
from fipa_codec.communicate import Communicate, encode
from fipa_codec.errors import FipaError
from fipa_codec.languages import Kind, Languages
from fipa_codec.performatives import Performative
from fipa_codec.tables import Role
from operate.cli.errors import ConsoleError, NoRunError
from operate.cli.fleet import identity
from operate.cli.runs import folders
from operate.run_folder import Fleet
from operate.system import System
from topdown.judge.follow import Followed

RECEIPT_S = 2.0
"""Time to wait for a receipt [s]: one takes milliseconds, a peer restarted just now a second (estimate)."""
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


def say(system: System, run: Path, draft: Communicate, wait_s: float, tell: Tell, *, force: bool) -> Sending:
    """Say it, and listen until its conversation has ended or `wait_s` is over.

    Raises ConsoleError where no fleet runs, or the agent does and nothing is forced.
    """
    fleet = folders.living(run) or folders.around()
    if fleet is None:
        raise NoRunError(str(run), f"no fleet was started in {run}; `roco up` starts one")
    if (draft.sender, draft.receiver, draft.protocol, draft.performative) not in system.design.rules:
        return _voiced(system, run, fleet, draft, wait_s, tell)
    try:
        first = system.design.agent(draft.sender).initial
        languages = system.languages or Languages()
        wires = wiring(draft.sender, fleet.system, design=system.design, languages=languages)
        tls = identity.tls(run, fleet, draft.sender)
        here = os.environ.get(LISTEN_VARIABLE, "")  # in a container
        links = Links(Options(keys=identity.folder(run, fleet), agents=fleet.agents, listen=here), wires)
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
        return f"not receipted by {to}: it is kept in the journal, and the next life of {me} sends it again"
    receipted = f"receipted by {to}; " if done.receipted else ""
    if done.ended:
        return f"{receipted}the conversation has ended"
    return receipted + ("nothing came back" if not done.heard else f"{len(done.heard)} came back")


def _refusal(agent: str, error: RuntimeFault) -> str:
    if isinstance(error, StandInError) and not error.lives:
        return f"{error}; is the fleet up? (`roco status`)"
    return (
        f"{agent} runs ({error}), and its streams are numbered: a message in its place would take a number that it will"
        " use. Leave it out (`roco up --only ...`), or say it with --force, which may confuse its peers"
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


def _voiced(system: System, run: Path, fleet: Fleet, draft: Communicate, wait_s: float, tell: Tell) -> Sending:
    """In the name of an agent that lives, or as no agent could: on its key, without number, token or receipt.

    Where there are keys, router or receiver takes only what the design lets the sender say.
    """
    design = system.design
    template = design.file.system.key
    ears = template.format(
        system=fleet.system, channel="*", sender="*", receiver=draft.sender, protocol="*", performative="*"
    )
    stamp = f"forced-{time.time_ns() // 1_000_000:x}"
    id = draft.id or stamp
    label, named = draft.reply_with or id, draft.conversation or stamp
    one = msgspec.structs.replace(draft, id=id, conversation=named, reply_with=label, sent=time.time())
    channels = design.peers(draft.sender) if draft.sender in design.agents else {}
    key = template.format(
        system=fleet.system,
        channel=channels.get(draft.receiver, NO_CHANNEL),
        sender=one.sender,
        receiver=one.receiver,
        protocol=one.protocol,
        performative=one.performative.value,
    )
    at = fleet.agents.get(draft.receiver, fleet.connect)
    voice = Voice(at, (ears,), tls=identity.tls(run, fleet, draft.sender))
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
        self._followed = Followed(system.design.tables[opening.protocol], durable=True) if new else None
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


def _sending(one: Communicate, receipted: bool | None, ended: bool, heard: list[Communicate]) -> Sending:
    return Sending(_fields(one), len(encode(one)), receipted, ended, tuple(_fields(answer) for answer in heard))


def _fields(one: Communicate) -> dict[str, Any]:
    """A communicate by the names of its fields, its content as what it is."""
    found = {name: getattr(one, name) for name in one.__struct_fields__}
    found["content"] = None if one.content is msgspec.UNSET else msgspec.msgpack.decode(one.content)
    return {name: value for name, value in found.items() if value not in ("", None)}
