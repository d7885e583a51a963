"""A design, and all that is derived from its file: channels, keys, rules for each message,
interfaces, state machines, tables of its own, rulings.

What the paper has in tables (sections 4 and 5) a designer types once in a file; the rest is
computed here, so that it cannot drift. Nothing here knows a particular system, Zenoh or a clock.
"""

import re
from collections.abc import Iterator
from functools import cached_property
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple, TypeVar
from typing import Protocol as Shape

import msgspec

from fipa_codec.errors import LocalProtocolError
from fipa_codec.languages import REASON as REASON_LANGUAGE
from fipa_codec.languages import Kind, Reason
from fipa_codec.performatives import Performative
from fipa_codec.protocols import named
from fipa_codec.tables import START, Protocol, Row, Table
from topdown.model import elements, loading
from topdown.model.decomposition import Channel, Decomposition, decompose
from topdown.model.errors import DesignError, NoSuchEntry
from topdown.model.loading import Path_, line_of

T = TypeVar("T")


class Addressed(Shape):
    """The parts of a key expression; a communicate has them."""

    @property
    def sender(self) -> str: ...
    @property
    def receiver(self) -> str: ...
    @property
    def protocol(self) -> str: ...
    @property
    def performative(self) -> Performative: ...


class Rule(msgspec.Struct, frozen=True):
    """The rule for one key: act, sender and receiver, language and contents, largest size.

    `contents`: language.Class of each content the act may have (none: no content). `bytes`: largest
    size, of all contents. `sizes`: largest size per content class. `durable`: numbered and
    journalled; `latest`: only the newest value counts. `language`: the one it is written in, but
    for a Reason, which refuse, failure and not-understood may always carry.
    """

    channel: str
    sender: str
    receiver: str
    protocol: str
    performative: Performative
    use: str
    language: str
    ontology: str
    contents: tuple[str, ...]
    sizes: dict[str, int]
    bytes: int
    durable: bool
    latest: bool
    latency_s: float


class Side(msgspec.Struct, frozen=True):
    """An agent's interface: performatives, languages and ontologies it sends and those it receives
    (paper, section 4, step 4).
    """

    sends: frozenset[Performative]
    receives: frozenset[Performative]
    languages_sent: frozenset[str]
    languages_received: frozenset[str]
    ontologies_sent: frozenset[str]
    ontologies_received: frozenset[str]


# What a peer may always answer with, in the language everybody reads, and the size it may have (a
# reason in words; estimate).
REASON = f"{REASON_LANGUAGE.name}.{Reason.__name__}"
REASON_BYTES = 1000
_MAY_SAY_WHY = (Performative.NOT_UNDERSTOOD, Performative.REFUSE, Performative.FAILURE)


class Included(NamedTuple):
    """An included system; `design` None: why it is not there, and what would be right."""

    entry: elements.Include
    design: "Design | None"
    wrong: str = ""
    right: str = ""


class Design(msgspec.Struct, frozen=True, dict=True):
    """A design: its file's entries and what follows from them. Look-ups raise NoSuchEntry, which
    lists what there is. `above`: the files that include it, the outermost first.
    """

    file: elements.DesignFile
    path: str = ""
    text: str = ""
    folder: str = ""
    above: tuple[str, ...] = ()

    @property
    def place(self) -> Path:
        """The file it was loaded from."""
        return Path(self.folder, self.path)

    @cached_property
    def decomposition(self) -> Decomposition:
        """Stages, groups' tasks, slips."""
        return decompose(self.file.system.root, self.file.step)

    @cached_property
    def channels(self) -> dict[str, Channel]:
        """The channels of the finished design, by id."""
        return {channel.id: channel for channel in self.decomposition.last.channels}

    @cached_property
    def agents(self) -> dict[str, elements.Agent]:
        """The agents by name, with their state machines."""
        return {agent.name: agent for agent in self.file.agent}

    @cached_property
    def protocols(self) -> dict[str, elements.Protocol]:
        """The uses of protocols by name."""
        return {protocol.name: protocol for protocol in self.file.protocol}

    @cached_property
    def guests(self) -> dict[str, elements.Guest]:
        """The guests by name."""
        return {guest.name: guest for guest in self.file.guest}

    @cached_property
    def guest_uses(self) -> dict[str, elements.Protocol]:
        """The uses of protocols of all guests by name, written out; without those that name what is
        not there.
        """
        return {
            use.name: self._of_guest(guest.name, use)
            for guest in self.file.guest
            for use in guest.use
            if (use.follows or use.like in self.protocols)
            and use.agent in self.agents
            and self.interfaces.keys()
            >= {*use.interface, *(() if use.follows else self.protocols[use.like].interface)}
        }

    def guest_use(self, guest: str, agent: str, follows: str) -> elements.Protocol:
        """The use of a guest with an agent that follows this protocol. Raises NoSuchEntry."""
        known = {(use.participant, use.follows): use for use in self.uses_of(guest)}
        if (agent, follows) not in known:
            with_it = sorted(one for to, one in known if to == agent)
            raise NoSuchEntry(f"protocol between {guest} and {agent}", follows, with_it)
        return known[agent, follows]

    @cached_property
    def written(self) -> tuple[tuple[elements.Protocol, Path_], ...]:
        """The uses of protocols whose messages stand in the file, each with its place there: those
        of agents, and those of guests that are like no other.
        """
        own = ((use, ("protocol", number)) for number, use in enumerate(self.file.protocol))
        of_guests = (
            (self._of_guest(guest.name, use), ("guest", number, "use", place))
            for number, guest in enumerate(self.file.guest)
            for place, use in enumerate(guest.use)
            if use.follows
        )
        return (*own, *of_guests)

    @cached_property
    def included(self) -> dict[str, Included]:
        """The systems that it includes, by their names here; read when this is asked first."""
        return {entry.name: _included(self, entry) for entry in self.file.include}

    @cached_property
    def included_uses(self) -> dict[str, elements.Protocol]:
        """The uses of included systems in which states of agents talk, by name: the agent asks, the
        included system answers. Any other use of a guest is its devices' business.
        """
        states = ((agent.name, state) for agent in self.file.agent for state in agent.state)
        talked = {(name, use) for name, state in states for use in state.talks}
        return {
            use.name: use
            for name, one in self.included.items()
            if one.design is not None
            for guest in one.entry.guest
            for there in one.design.uses_of(guest.guest)
            for use in (_as_included(name, guest.agent, there),)
            if (guest.agent, use.name) in talked
        }

    def uses_of(self, guest: str) -> tuple[elements.Protocol, ...]:
        """The uses of a guest; none where there is no such guest."""
        return tuple(use for use in self.guest_uses.values() if use.initiator == guest)

    @cached_property
    def interfaces(self) -> dict[str, elements.Interface]:
        """The sets of interface entries by name."""
        return {interface.name: interface for interface in self.file.interface}

    @cached_property
    def signals(self) -> dict[str, elements.Signal]:
        """The kinds of traffic beside communicates, each with the names of its writers and
        readers.
        """
        return {entry.kind: self.with_agents(entry) for entry in self.file.signal}

    def with_agents(self, signal: elements.Signal) -> elements.Signal:
        """The signal with the names of all agents in place of the word for them."""
        every = {elements.AGENTS: tuple(self.agents)}
        writers, readers = (
            tuple(dict.fromkeys(one for name in names for one in every.get(name, (name,))))
            for names in (signal.writers, signal.readers)
        )
        return msgspec.structs.replace(signal, writers=writers, readers=readers)

    @cached_property
    def own_tables(self) -> dict[str, Protocol]:
        """The interaction protocols that the design brings along, by name. Raises DesignError."""
        return {
            entry.name: own_table(
                entry, self.path or "design.toml", line_of(self.text, ("table", index))
            )
            for index, entry in enumerate(self.file.table)
        }

    @cached_property
    def tables(self) -> dict[str, Protocol]:
        """The table of every protocol that is followed, by the name under which it is; unknown ones
        are left out.
        """
        found = dict(self.own_tables)
        for name in sorted({use.follows for use, _ in self.written} - found.keys()):
            if (table := fipa_table(name)) is not None:
                found[name] = table
        for use in self.included_uses.values():
            there = self.included[use.participant].design
            if there is not None and use.follows in there.tables:
                found.setdefault(use.follows, there.tables[use.follows])
        return found

    @cached_property
    def rules(self) -> dict[tuple[str, str, str, Performative], Rule]:
        """Every rule, by (sender, receiver, protocol, performative)."""
        found: dict[tuple[str, str, str, Performative], Rule] = {}
        for use in (*self.file.protocol, *self.guest_uses.values()):
            for rule in self._rules_of(use):
                key = (rule.sender, rule.receiver, rule.protocol, rule.performative)
                found[key] = _joined(found[key], rule) if key in found else rule
        return found

    def agent(self, name: str) -> elements.Agent:
        """The agent of this name."""
        return _look_up("agent", name, self.agents)

    def protocol(self, name: str) -> elements.Protocol:
        """The use of a protocol of this name."""
        return _look_up("protocol", name, self.protocols)

    def peers(self, agent: str) -> dict[str, str]:
        """Agents that share a channel with this one -> the channel's id."""
        self.agent(agent)
        return {
            channel.other(agent): channel.id
            for channel in self.channels.values()
            if agent in channel.ends
        }

    def rule(self, message: Addressed) -> Rule:
        """The rule a communicate must obey. Raises NoSuchEntry where the design has no such
        message.
        """
        key = (message.sender, message.receiver, message.protocol, message.performative)
        rule = self.rules.get(key)
        if rule is None:
            known = sorted(p for s, r, i, p in self.rules if (s, r, i) == key[:3])
            kind = f"message {message.sender}->{message.receiver} in {message.protocol}"
            raise NoSuchEntry(kind, message.performative, known)
        return rule

    def key(self, system: str, message: Addressed) -> str:
        """The key expression a communicate travels on. Raises NoSuchEntry where the design has no
        such message.
        """
        return self.key_of(system, self.rule(message))

    def key_of(self, system: str, rule: Rule) -> str:
        """The key expression of a rule."""
        return self.file.system.key.format(
            system=system,
            channel=rule.channel,
            sender=rule.sender,
            receiver=rule.receiver,
            protocol=rule.protocol,
            performative=rule.performative.value,
        )

    def keys_to(self, system: str, receiver: str) -> str:
        """The key expression (with wildcards) of everything said to an agent, a group or a
        guest.
        """
        if receiver not in {*(group.name for group in self.file.group), *self.guests}:
            self.agent(receiver)
        return self.file.system.key.format(
            system=system,
            channel="*",
            sender="*",
            receiver=receiver,
            protocol="*",
            performative="*",
        )

    def signal_key(
        self, kind: str, *, system: str, owner: str, peer: str = "*", incarnation: int | str = "*"
    ) -> str:
        """The key expression of traffic other than communicates."""
        signal = _look_up("signal", kind, self.signals)
        return signal.key.format(system=system, owner=owner, peer=peer, incarnation=incarnation)

    def allowed(self, sender: str, receiver: str, protocol: str) -> frozenset[Performative]:
        """The acts one agent may say to another in a protocol."""
        return frozenset(
            p for s, r, i, p in self.rules if (s, r, i) == (sender, receiver, protocol)
        )

    def use(self, one: str, other: str, follows: str) -> elements.Protocol:
        """The use of protocol `follows` (a communicate's protocol field) between two agents, in
        either role.
        """
        ends = {one, other}
        for use in self.file.protocol:
            if use.follows == follows and {use.initiator, use.participant} == ends:
                return use
        known = (
            use.follows for use in self.file.protocol if {use.initiator, use.participant} == ends
        )
        raise NoSuchEntry(f"protocol between {one} and {other}", follows, known)

    def entries(self, use: str) -> tuple[elements.InterfaceEntry, ...]:
        """The interface entries of a use of a protocol."""
        names = self.protocol(use).interface
        return tuple(entry for name in names for entry in self._entries_of(name))

    def side(self, agent: str) -> Side:
        """The interface of an agent: what it sends and receives in its conversations; guests have
        none with it.
        """
        inner = [rule for rule in self.rules.values() if rule.use not in self.guest_uses]
        out = [rule for rule in inner if rule.sender == agent]
        into = [rule for rule in inner if rule.receiver == agent]
        return Side(
            sends=frozenset(rule.performative for rule in out),
            receives=frozenset(rule.performative for rule in into),
            languages_sent=frozenset(rule.language for rule in out if rule.language),
            languages_received=frozenset(rule.language for rule in into if rule.language),
            ontologies_sent=frozenset(rule.ontology for rule in out if rule.ontology),
            ontologies_received=frozenset(rule.ontology for rule in into if rule.ontology),
        )

    def conditions(self, agent: str) -> frozenset[str]:
        """The names an agent's code must bind: initial conditions of arcs, terminal and error
        conditions of states.
        """
        entry = self.agent(agent)
        ends = [name for state in entry.state for name in (state.terminal, state.error)]
        return frozenset(name for name in [*ends, *(arc.when for arc in entry.arc)] if name)

    def contents(self, use: elements.Protocol, message: elements.Message) -> tuple[str, ...]:
        """language.Class of every content of a message; "*set" becomes the argument or answer
        classes of the set.
        """
        names: list[str] = []
        for content in message.content:
            if not content.startswith("*"):
                names.append(f"{message.language}.{content}")
                continue
            for entry in self._entries_of(content[1:]):
                names += entry.arguments if message.sender == use.initiator else entry.answers
        return tuple(dict.fromkeys(names))

    def _of_guest(self, guest: str, wanted: elements.GuestUse) -> elements.Protocol:
        """The use that it is like, with the guest and its agent as ends, or its own. Volatile:
        nobody keeps a word for a guest that is not there.
        """
        if wanted.follows:
            return elements.Protocol(
                name=wanted.name,
                channel=wanted.channel,
                follows=wanted.follows,
                initiator=guest,
                participant=wanted.agent,
                durable=False,
                message=wanted.message,
                interface=wanted.interface,
                ruling=wanted.ruling,
            )
        model = self.protocol(wanted.like)
        ends = {model.initiator: guest, model.participant: wanted.agent}
        offered = wanted.interface or model.interface
        entries = (entry for name in offered for entry in self._entries_of(name))
        allowed = {name for entry in entries for name in entry.arguments}
        messages: list[elements.Message] = []
        for one in model.message:
            contents = self.contents(model, one)
            if one.sender == model.initiator and contents:
                contents = tuple(name for name in contents if name in allowed)
                if not contents:
                    continue
            names = tuple(name.partition(".")[2] for name in contents)
            sender = ends[one.sender]
            messages.append(msgspec.structs.replace(one, sender=sender, content=names))
        return msgspec.structs.replace(
            model,
            name=wanted.name,
            channel=wanted.channel,
            initiator=guest,
            participant=wanted.agent,
            durable=False,
            latest=False,
            interface=offered,
            message=tuple(messages),
            within="",
        )

    def _entries_of(self, interface: str) -> tuple[elements.InterfaceEntry, ...]:
        return _look_up("interface", interface, self.interfaces).entries

    def _rules_of(self, use: elements.Protocol) -> list[Rule]:
        rules = [self._rule(use, message) for message in use.message]
        for sender in (use.initiator, use.participant):
            not_understood = elements.Message(
                sender=sender,
                performative=Performative.NOT_UNDERSTOOD,
                language=REASON_LANGUAGE.name,
                bytes=REASON_BYTES,
            )
            rules.append(self._rule(use, not_understood))
        return rules

    def _rule(self, use: elements.Protocol, message: elements.Message) -> Rule:
        contents = self.contents(use, message)
        sizes = dict.fromkeys(contents, message.bytes)
        if message.performative in _MAY_SAY_WHY:
            sizes[REASON] = REASON_BYTES
        return Rule(
            channel=use.channel,
            sender=message.sender,
            receiver=use.peer(message.sender),
            protocol=use.follows,
            performative=message.performative,
            use=use.name,
            language=message.language,
            ontology=use.ontology
            if message.performative is not Performative.NOT_UNDERSTOOD
            else "",
            contents=tuple(sizes),
            sizes=sizes,
            bytes=max(message.bytes, *sizes.values(), 0),
            durable=use.durable,
            latest=use.latest and message.performative is Performative.INFORM,
            latency_s=use.latency_s,
        )


def load(path: Path, above: tuple[str, ...] = ()) -> Design:
    """The design in the file at `path`; `above`: files that include it. Raises DesignError."""
    text = loading.text_of(path)
    read = loading.read(text, str(path))
    return Design(read, path.name, text, str(path.resolve().parent), above)


# --- Included systems -----------------------------------------------------------------------------


def _included(design: Design, entry: elements.Include) -> Included:
    package, _, inside = entry.file.rpartition(":")
    right = "name a design file, from this one's folder, or PACKAGE:FILE of an installed package"
    path = Path(design.folder, entry.file)
    if package:
        # of a package without a dot nothing is imported
        found = find_spec(package) if package.isidentifier() else None
        if found is None or not found.submodule_search_locations:
            return Included(entry, None, f"no package {package!r} is installed", right)
        path = Path(found.submodule_search_locations[0], inside)
    chain = (*design.above, str(design.place.resolve()))
    if (again := str(path.resolve())) in chain:
        circle = " includes ".join((*chain[chain.index(again) :], again))
        return Included(entry, None, f"{circle}: a circle", "include no design that includes this")
    if not path.is_file():  # who wrote the design may name a pipe or a device, which has no end
        return Included(entry, None, f"{path} is no file", right)
    try:
        there = load(path, chain)
    except OSError as error:
        return Included(entry, None, f"{path} cannot be read ({error.strerror})", right)
    except DesignError as error:
        place = error.file if error.line is None else f"{error.file}:{error.line}"
        return Included(entry, None, f"{place}: {error.field}: {error.wrong}", error.right)
    for one in there.included.values():
        if one.design is None:
            return Included(
                entry, None, f"{path}, include {one.entry.name}: {one.wrong}", one.right
            )
    return Included(entry, there)


def _as_included(name: str, agent: str, use: elements.Protocol) -> elements.Protocol:
    """A guest's use as the including design has it: `agent` asks the system `name`."""
    ends = {use.initiator: agent, use.participant: name}
    said = (msgspec.structs.replace(one, sender=ends[one.sender]) for one in use.message)
    return msgspec.structs.replace(
        use,
        name=f"{name}.{use.name}",
        channel=name,
        initiator=agent,
        participant=name,
        message=tuple(said),
    )


def _joined(one: Rule, other: Rule) -> Rule:
    """Two rows of the same act (contents with different budgets) are one rule."""
    return msgspec.structs.replace(
        one,
        contents=tuple(dict.fromkeys((*one.contents, *other.contents))),
        sizes={**one.sizes, **other.sizes},
        bytes=max(one.bytes, other.bytes),
    )


def _look_up(kind: str, name: str, table: dict[str, T]) -> T:
    """An entry by name. Raises NoSuchEntry."""
    if name not in table:
        raise NoSuchEntry(kind, name, table)
    return table[name]


# --- Interaction protocols that a design brings along, beside FIPA's: entries of the file made
# into tables of rows
# Also the word by which files and people name a use of a performative: `inform`, `inform[final]`.


_WORD = re.compile(r"(?P<act>[a-z-]+)(?:\[(?P<kind>[a-z]+)\])?")


def act_word(word: str) -> tuple[Performative, Kind]:
    """Performative and guard word of `inform[final]`. Raises ValueError, which says what there
    is.
    """
    match = _WORD.fullmatch(word)
    if match is None:
        raise ValueError(f"{word!r} is not an act; write `inform` or `inform[final]`")
    try:
        return Performative(match["act"]), Kind(match["kind"] or "")
    except ValueError:
        kinds = ", ".join(kind for kind in Kind if kind)
        raise ValueError(
            f"{word!r}: acts are {', '.join(Performative)}; guard words {kinds}"
        ) from None


def fipa_table(name: str) -> Protocol | None:
    """FIPA's protocol of that name or alias; None where there is none."""
    try:
        return named(name)
    except LocalProtocolError:
        return None


def own_table(
    entry: elements.Table, file: str = "design.toml", line: int | None = None
) -> Protocol:
    """The protocol of an entry. Raises DesignError."""
    try:
        for role, table in (("initiator", entry.initiator), ("participant", entry.participant)):
            _leads_on(role, table)
        return Protocol(
            entry.name,
            initiator=_role(entry.initiator),
            participant=_role(entry.participant),
            confirmed=entry.confirmed,
            rounds=entry.rounds,
        )
    except (ValueError, LocalProtocolError) as error:
        right = "rows are [state, send or receive, act, next state], one for each state and act"
        raise DesignError(file, line, f"table {entry.name}", str(error), right) from error


def _leads_on(role: str, table: elements.RoleTable) -> None:
    """Raises ValueError for a row that leads to where the conversation neither goes on nor ends,
    and where no conversation begins.
    """
    left = {state for state, *_ in table.rows} | {*table.ended, *table.resting}
    for row in table.rows:
        if row[-1] not in left:
            where = f"{row[-1]!r}, which no row leaves, and which is not under `ended`"
            raise ValueError(f"{role}: row {row[0]} {row[1]} {row[2]} leads to {where}")
    if table.rows and START not in {state for state, *_ in table.rows}:
        raise ValueError(f"{role}: no row begins in {START!r}, where every conversation begins")


def _role(role: elements.RoleTable) -> Table:
    rows = [Row(state, way, *act_word(act), to) for state, way, act, to in role.rows]
    return Table(rows, ended=role.ended, urgent=role.urgent, resting=role.resting)


# --- The rulings of a design: where its source is silent or contradicts itself, what the design
# does instead


_NAMES = ("name", "id", "kind")


class Ruling(msgspec.Struct, frozen=True):
    """A ruling, the entry it stands on, its line; None: not known."""

    where: str
    text: str
    line: int | None


def rulings(design: Design) -> tuple[Ruling, ...]:
    """Every ruling, in the file's order."""
    found = [
        Ruling(where, text, line_of(design.text, at))
        for where, text, at in _walk(design.file, "", ())
    ]
    return tuple(sorted(found, key=lambda one: one.line or 0))


def _walk(entry: object, where: str, at: Path_) -> Iterator[tuple[str, str, Path_]]:
    if isinstance(entry, tuple):
        for index, one in enumerate(entry):
            yield from _walk(one, f"{where} {_name(one, index)}", (*at, index))
    elif isinstance(entry, msgspec.Struct):
        if text := getattr(entry, "ruling", ""):
            yield where.strip(), text, (*at, "ruling")
        for field in msgspec.structs.fields(entry):
            inside = f"{where}, {field.encode_name}" if where else field.encode_name
            yield from _walk(getattr(entry, field.name), inside, (*at, field.encode_name))


def _name(entry: object, index: int) -> str:
    """The name of a list's entry; of a message, sender and act; else its number."""
    names = [str(getattr(entry, field)) for field in _NAMES if hasattr(entry, field)]
    if hasattr(entry, "performative") and hasattr(entry, "sender"):
        names = [f"{entry.sender} {entry.performative}"]
    return names[0] if names else str(index + 1)
