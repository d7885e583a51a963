"""Entries of a design file: one frozen Struct for each kind of entry, with the file's own field
names.

The design method of the paper, sections 4 and 5: requirement tree, binary decomposition, channels,
protocols, interfaces, and the agents' finite state machines. `ruling` on any entry: the paper is
silent or contradicts itself, and this is what the design does. Nothing here knows a particular
system.
"""

from enum import StrEnum
from typing import Annotated

import msgspec

from fipa_codec.performatives import Performative
from fipa_codec.tables import Role, Way

# --- The method's own entries of a design file: the requirement tree, and the steps of the
# decomposition
# The paper, section 4, steps 1 and 2. `ruling` on any entry: the paper is silent or contradicts
# itself, and this is what the design does.


class Entry(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """An entry of a design file: unknown fields are errors, since they are misspelt ones."""

    ruling: str = ""


class Requirement(Entry, frozen=True):
    """A node of the requirement tree; no `parent`: a root.

    `evidence`: what shows that it is met, each "event:NAME" (of a run's report), "test:PATH" or
    "test:PATH::NAME", "message:USE act" or "message:USE act CLASS" (a communicate of a recording).
    """

    id: str
    text: str
    parent: str = ""
    evidence: tuple[str, ...] = ()


class Division(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A group is divided in two halves, both with coherent tasks."""

    group: str
    into: tuple[str, str]


class Task(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The task of a group."""

    group: str
    text: str


class Reallocation(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The divided group's end of a channel goes to one half."""

    channel: str
    to: str


class Split(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Both halves need the channel: it is retired, and two new ones take its place (first and
    second half).
    """

    channel: str
    into: tuple[str, str]


class Complement(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A channel transmits more than before."""

    channel: str
    adds: str


class NewChannel(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A channel that arises in a step."""

    id: str
    between: tuple[str, str]
    transmits: str


class Stop(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The designer judges the group graspable: it is divided no further."""

    group: str
    reason: str


class Step(Entry, frozen=True):
    """A step of the decomposition, for one or more requirements (paper, section 4, step 2)."""

    requirements: tuple[str, ...]
    divide: Division | None = None
    tasks: tuple[Task, ...] = ()
    reallocate: tuple[Reallocation, ...] = ()
    split: tuple[Split, ...] = ()
    complement: tuple[Complement, ...] = ()
    channels: tuple[NewChannel, ...] = ()
    stop: tuple[Stop, ...] = ()


class Group(Entry, frozen=True):
    """A group that stays a group in this design: divided no further here, and no agent."""

    name: str
    text: str = ""


class StatedChannel(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A channel as the designer lists it at the end."""

    id: str
    between: tuple[str, str]


class GuestUse(Entry, frozen=True):
    """What a guest may say to one agent in a protocol: it is the initiator, `agent` the
    participant.

    `like`: another use of a protocol, whose acts and contents these are; `interface`: the sets of
    its entries that the guest may ask for; none: all. Where agents have no such use: `follows`,
    `interface` and `message` as of a Protocol, in place of `like`. `channel`: that of the guest and
    the agent. `consent`: a person must agree to each opening.
    """

    name: str
    channel: str
    agent: str
    like: str = ""
    interface: tuple[str, ...] = ()
    consent: bool = False
    follows: str = ""
    message: tuple["Message", ...] = ()


class Guest(Entry, frozen=True):
    """Somebody outside who may say what its rows list, and nothing else. It is not a group of the
    decomposition: no agent waits for it, relies on it or holds a conversation with it; a door
    of the agent's process takes its words and answers them.

    `by`: how it comes in, such as MCP, for people. `each_minute`: conversations that it may open
    within a minute with one agent. `withheld`: fields of contents that it may not set.
    """

    name: str
    by: tuple[str, ...]
    each_minute: int
    use: tuple[GuestUse, ...]
    withheld: tuple[str, ...] = ()
    text: str = ""


class IncludedGuest(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Which guest of an included design an agent of this one is."""

    agent: str
    guest: str


class Include(Entry, frozen=True):
    """Another system, with a design of its own, that agents of this one are guests of.

    `file`: its design file, from this file's folder, or `PACKAGE:FILE` of an installed Python
    package. A use of a guest is called `NAME.USE` here, with the agent as its initiator and NAME as
    the other end.
    """

    name: str
    file: str
    guest: tuple[IncludedGuest, ...]
    text: str = ""


class Outcome(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The sets the method puts out, written down: agents, groups that stay groups, channels (paper,
    section 4).

    `where`: the place they stand in, as people find it.
    """

    where: str
    agents: tuple[str, ...] = ()
    groups: tuple[str, ...] = ()
    channels: tuple[StatedChannel, ...] = ()


# --- Entries of a design file ---------------------------------------------------------------------


class System(Entry, frozen=True):
    """The system as a whole. `root`: the group that is divided first. `key`: template of a
    communicate's key expression. `recorders`: identities, no agents, that may hear every
    communicate and say none.
    """

    name: str
    root: str
    key: str
    text: str = ""
    recorders: tuple[str, ...] = ()


AGENTS = "agents"
"""Among a signal's writers or readers: every agent of the design."""


class Signal(Entry, frozen=True):
    """Traffic other than communicates (liveliness, receipts, pings ...): its key template, its
    writers and readers (AGENTS among them stands for every agent).

    `reach`: pairs of a writer and a peer; a writer that is named here writes to no other peers.
    """

    kind: str
    key: str
    writers: tuple[str, ...]
    readers: tuple[str, ...]
    reach: tuple[tuple[str, str], ...] = ()
    text: str = ""


class Language(Entry, frozen=True):
    """A content language by name; its classes are Python's business and are compared by the checks.

    `classes`: their names, where the design is to be checked without code (none: the code knows
    them).
    """

    name: str
    classes: tuple[str, ...] = ()
    text: str = ""


class Ontology(Entry, frozen=True):
    """An ontology by name, in a file beside the design."""

    name: str
    file: str
    text: str = ""


class InterfaceEntry(msgspec.Struct, frozen=True, array_like=True, forbid_unknown_fields=True):
    """[performative, name, argument classes, answer classes]; a class is written LANGUAGE.Class."""

    performative: Performative
    name: str
    arguments: tuple[str, ...]
    answers: tuple[str, ...]


class Interface(Entry, frozen=True):
    """A named set of entries, which several protocols may share."""

    name: str
    entries: tuple[InterfaceEntry, ...]


class Message(Entry, frozen=True):
    """Sender, act and language of a message; `content`: class names of that language ("*set": those
    of an interface), none = no content.

    `bytes`: the largest size of the whole communicate; 0: no budget is stated. For estimates:
    `typical_bytes`, and `count`, how often it is said per conversation of its use, or of the use
    `each`; none of a use has one: as often as in its shortest conversation.
    """

    sender: str
    performative: Performative
    language: str
    bytes: int = 0
    content: tuple[str, ...] = ()
    typical_bytes: int = 0
    count: float | None = None
    each: str = ""


class RoleTable(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A role's rows [state, "send" or "receive", performative, next state]; a guard word stands
    behind its act, as in `inform[final]`. `ended`, `urgent`, `resting`: as fipa_codec.tables.Table
    has them.
    """

    rows: tuple[tuple[str, Way, str, str], ...]
    ended: tuple[str, ...]
    urgent: tuple[str, ...] = ()
    resting: tuple[str, ...] = ()


class Table(Entry, frozen=True):
    """An interaction protocol of the system's own, beside FIPA's: what `follows` may name.

    `confirmed`: performatives whose every use is confirmed by name. `rounds`: openings that may
    come again within a conversation, as a new round of it.
    """

    name: str
    initiator: RoleTable
    participant: RoleTable
    confirmed: tuple[Performative, ...] = ()
    rounds: tuple[Performative, ...] = ()
    text: str = ""


class Protocol(Entry, frozen=True):
    """A use of an interaction protocol on a channel.

    `follows`: the name of its table of rows, which is also the communicate's protocol field.
    `durable`: numbered, journalled, re-sent. `latest`: of informs only the newest value of a
    subject counts. `latency_s`: what an answer should need at most; 0: no budget is stated.
    `answer`: the acts that answer in this sense; none: whatever comes first. For estimates:
    `within`, the use in whose conversations this one's are opened (none: a person or the start
    opens them), `per`, how many in each (none: one); `typical_s`, what one takes besides those
    opened within it; `typical_latency_s`, what its answer takes; `alongside`: it goes on beside the
    others, nobody waits for its end.
    """

    name: str
    channel: str
    follows: str
    initiator: str
    participant: str
    durable: bool
    message: tuple[Message, ...]
    latency_s: float = 0.0
    answer: tuple[Performative, ...] = ()
    interface: tuple[str, ...] = ()
    ontology: str = ""
    latest: bool = False
    within: str = ""
    per: float | None = None
    typical_s: float = 0.0
    typical_latency_s: float = 0.0
    alongside: bool = False

    def peer(self, agent: str) -> str:
        """The end beside `agent`."""
        return self.participant if agent == self.initiator else self.initiator

    def role(self, agent: str) -> Role:
        """The role of one of the ends."""
        return Role.INITIATOR if agent == self.initiator else Role.PARTICIPANT


class State(Entry, frozen=True):
    """A state: its behaviour, the names of its terminal and error conditions, the protocols it acts
    in.

    `says`: what the agent does in it, in words for people who watch it run, as in "waits for a
    task".
    """

    name: str
    behaviour: str
    terminal: str
    error: str = ""
    talks: tuple[str, ...] = ()
    text: str = ""
    says: str = ""


class ParameterType(StrEnum):
    """Types of a parameter."""

    INTEGER = "integer"
    NUMBER = "number"
    TEXT = "text"
    BOOLEAN = "boolean"


class Parameter(Entry, frozen=True):
    """A value of an agent that an operator may set while it runs; its behaviours read it at each
    step.

    `least`, `most`: bounds of an integer or a number, both allowed; `choices`: the only values
    (none: all). `says`: what it does, in words for people who set it.
    """

    name: str
    type: ParameterType
    default: bool | int | float | str
    says: str
    least: float | None = None
    most: float | None = None
    choices: tuple[bool | int | float | str, ...] = ()
    unit: str = ""
    text: str = ""


class Arc(Entry, frozen=True):
    """An arc, labelled by the name of its initial condition; no `when`: True."""

    source: str
    target: str
    when: str = ""


class Row(Entry, frozen=True, rename={"in_": "in"}):
    """An agent's action at one event: a row of its conversational behaviour, over states in which
    it waits.

    `in`: the states it stands in. `on`: the event, one of
        "USE act[kind]"   a message of the peer in that use of a protocol is taken; a message that
                          no row of the state names stays in the inbox
        "late USE"        the wait for the end of a conversation this agent opened is over
                          (reply-by, patience)
        "back AGENT"      a peer appeared, or came back under another incarnation
        "restart"         this agent was restored after a death: soft conversations are gone
        "own WORD"        something of its own side came to an end (worker, device, timer): it
                          will, sooner or later
        "person WORD"     somebody may do this, and nobody may wait for it
    `say`: what it says in the same step, in order, "USE act[kind]"; an opening begins a
    conversation. The row applies only where the protocols' tables allow all of it. `may`: what it
    may say besides. `drop`: uses whose volatile conversation it gives up. `when`: "USE state|state"
    of its conversations after the event ("none": not open), or "USE settled" / "USE unsettled"
    (nothing / something is due to the subscriber). `owes`: uses in which it now owes an
    observation. `waits`: uses whose conversation waits for its turn from now on; "USE waiting" in
    `when` holds while it does, and the row that asks for it ends that, as the conversation's end
    does; "USE served" holds else. `moves`: the use whose conversation this physical act serves; no
    act is begun twice in one. `to`: the state it then waits in; none: the same. `then`: a choice of
    the agent, each part of which is a way to go on: its words are said behind `say`, its `when`
    holds besides (after what is owed), its `to`, if any, counts. `several`: only where more than
    one conversation of a use is open at a time; such rows are compared with what runs, but are not
    explored.
    """

    in_: tuple[str, ...]
    on: str
    say: tuple[str, ...] = ()
    may: tuple[str, ...] = ()
    drop: tuple[str, ...] = ()
    when: tuple[str, ...] = ()
    owes: tuple[str, ...] = ()
    waits: tuple[str, ...] = ()
    moves: str = ""
    to: str = ""
    then: str = ""
    several: bool = False
    text: str = ""


class Onward(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A part of a choice."""

    say: tuple[str, ...] = ()
    when: tuple[str, ...] = ()
    to: str = ""


class Choice(Entry, frozen=True):
    """Ways to go on that several rows share; which of them is taken is the agent's business."""

    name: str
    ways: tuple[Onward, ...]
    text: str = ""


class Never(Entry, frozen=True, rename={"while_": "while"}):
    """A forbidden act: `agent` says one of `says` while all of `while_` holds.

    `while`: "AGENT in state|state", "AGENT owes USE", "AGENT USE state|state".
    """

    name: str
    agent: str
    says: tuple[str, ...]
    while_: tuple[str, ...]
    text: str = ""


class Ends(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One half of an agent's interface, as the designer declares it (paper, section 4, step 4)."""

    performatives: tuple[Performative, ...] = ()
    protocols: tuple[str, ...] = ()
    languages: tuple[str, ...] = ()
    ontologies: tuple[str, ...] = ()


class Agent(Entry, frozen=True):
    """An agent (a group of the same name that is divided no further) and the state machine of its
    control subsystem.

    `row`: its conversational behaviour, over the same states; `rest`: the states in which it is
    idle (none: `initial`). `choice`: ways to go on that rows share. `parameter`: values that an
    operator may set while it runs. `sends`, `receives`: its interface as declared, to be compared
    with the messages; none: it is derived from them.
    """

    name: str
    initial: str = ""
    state: tuple[State, ...] = ()
    arc: tuple[Arc, ...] = ()
    row: tuple[Row, ...] = ()
    choice: tuple[Choice, ...] = ()
    parameter: tuple[Parameter, ...] = ()
    rest: tuple[str, ...] = ()
    sends: Ends | None = None
    receives: Ends | None = None
    text: str = ""


FORMAT = 2
"""The newest format of design files; an older file is read where none of its entries is gone."""
CHANGES = {
    2: (
        "`[[house]]` is called `[[signal]]`, `[[claim]]` and `[tally]` are gone, and `while` of"
        " `[[never]]` is evaluated after the event, as guards are"
    )
}
"""What changed with a format, in a sentence without its full stop."""


class DesignFile(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The whole file. `format`: the one it is written in; files of the first one do not name it."""

    system: System
    requirement: tuple[Requirement, ...]
    step: tuple[Step, ...]
    language: tuple[Language, ...]
    interface: tuple[Interface, ...]
    protocol: tuple[Protocol, ...]
    agent: tuple[Agent, ...]
    signal: tuple[Signal, ...] = ()
    ontology: tuple[Ontology, ...] = ()
    table: tuple[Table, ...] = ()
    never: tuple[Never, ...] = ()
    group: tuple[Group, ...] = ()
    guest: tuple[Guest, ...] = ()
    include: tuple[Include, ...] = ()
    outcome: Outcome | None = None
    format: Annotated[int, msgspec.Meta(ge=1, le=FORMAT)] = 1
