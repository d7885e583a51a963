"""Targets of the fuzzer: each reader of bytes from elsewhere, the errors it may raise, and valid
inputs.
"""

import math
import shutil
import tempfile
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext, suppress
from functools import cache
from pathlib import Path

import msgspec
from http_target import REQUESTS
from http_target import serving as serving_http
from mutation import BINARY, MCAP, TEXT, Bytes, behind, content, flip, lengths, packed

from agent_runtime.core.control import Command, Pause, Resume, SetLevel, SetParameter
from agent_runtime.core.errors import RuntimeFault, StepLogError
from agent_runtime.core.events import Arrived, Next, Receipt, Started
from agent_runtime.core.state import CoreState
from agent_runtime.core.step import Core
from agent_runtime.io import steplog, zenoh_wire
from agent_runtime.io.journal import HEAD, MAGIC, MARK, Journal, frame, last_record
from agent_runtime.io.tap import Sample
from agent_runtime.io.zenoh_wire import Bytes as FromWire
from companion.design import LANGUAGES, wiring
from companion.stop_words import stop_words
from companion.tools.system import SYSTEM
from console.errors import UsageError
from console.faults import verbs as scenario
from fipa_codec import acl_string
from fipa_codec.communicate import decode, decode_strictly, encode
from fipa_codec.envelope import Envelope, pack, unpack
from fipa_codec.errors import FipaError, MalformedError
from operate.recording import contents, history, mcap_file
from operate.recording.ends import Ends
from operate.recording.index import NoRecordingError
from operate.recording.records import Garbage, Spoken, Token, sampled, understood
from services.coordinator import behaviours as coordinator
from services.human_interface import grammar, interpretation
from services.knowledge import behaviours as knowledge
from services.task import behaviours as task
from topdown import check
from topdown.model import design
from topdown.model.errors import TopdownError

ROOT = Path(__file__).parents[2]
HISTORIES = ROOT / "tests/histories"
FEW = 200
"""Seeds of a kind; estimate: as many as there are kinds of communicates, twice."""

Run = Callable[[bytes], None]


class Target(msgspec.Struct, frozen=True):
    """`read` opens what runs one input. `allowed`: the documented errors. `weight`: share of all
    inputs.

    `text`: for tables; `answers`: what becomes of wrong inputs where no error is raised.
    """

    name: str
    text: str
    seeds: Callable[[], list[bytes]]
    read: Callable[[Path], AbstractContextManager[Run]]
    changes: tuple[Bytes, ...]
    allowed: tuple[type[Exception], ...] = ()
    weight: float = 1.0
    answers: str = ""


class Broken(AssertionError):
    """A reader did not keep what it promises about what it accepts."""


def held(truth: bool, promise: str) -> None:
    """Raise Broken unless the promise is kept."""
    if not truth:
        raise Broken(promise)


def plain(run: Run) -> Callable[[Path], AbstractContextManager[Run]]:
    """Of a reader that needs no folder."""
    return lambda folder: nullcontext(run)


def filed(run: Callable[[Path], None]) -> Callable[[Path], AbstractContextManager[Run]]:
    """Of a reader of files."""

    def opened(folder: Path) -> AbstractContextManager[Run]:
        path = folder / "input"

        def written(data: bytes) -> None:
            path.write_bytes(data)
            run(path)

        return nullcontext(written)

    return opened


# --- communicates ---------------------------------------------------------------------------------


@cache
def recorded() -> tuple[Spoken, ...]:
    """Communicates of recorded runs, of each kind a few."""
    found: dict[tuple[str, ...], list[Spoken]] = {}
    for one in mcap_file.read(HISTORIES / "pour_seed_7/traffic.mcap", SYSTEM).records:
        if isinstance(one, Spoken) and one.size < 8000:
            kind = (one.sender, one.receiver, one.performative, type(one.content).__name__)
            found.setdefault(kind, []).append(one)
    return tuple(one for kind in found.values() for one in kind[:3])[:FEW]


def wires() -> list[bytes]:
    """Their bytes."""
    return [one.wire for one in recorded()]


def codec(data: bytes) -> None:
    """Check that an accepted input is encoded to something accepted as the same; its content is
    read or refused.
    """
    one = decode(data)
    held(decode(encode(one)) == one or "nan" in repr(one), "decode(encode(x)) is x")
    decode_strictly(data)
    LANGUAGES.read(one)


ACL_PEERS = (
    rb"(REQUEST :sender (agent-identifier :name ta@jade :addresses (sequence http://h:7778/acc)) "
    rb':receiver (set (agent-identifier :name co)) :content "((action (agent-identifier :name co)'
    rb' (pour \"jar\")))" '
    rb":language fipa-sl0 :ontology RoCo :protocol fipa-request "
    rb":conversation-id C17_3 :reply-with R3 :reply-by 20261123T120000000Z :X-JADE-Encoding None)",
    rb'(inform:sender(agent-identifier:namerock):receiver(set(agent-identifier:namega)):content#5"hello:protocolrequest'
    rb":reply-by+00000000T000010000)",
    rb"(query-ref :sender (agent-identifier :name pl :resolvers (sequence (agent-identifier :name"
    rb" df))) "
    rb':reply-to (set) :content #3"a"b :X-note 12d)',
)


def acl_texts() -> list[bytes]:
    """Texts of recorded communicates in each form, and some as JADE and Rock write."""
    forms = (acl_string.Form.READABLE, acl_string.Form.BINARY)
    return [
        *ACL_PEERS,
        *(
            acl_string.render(acl_string.to_acl(decode(wire), form=f))
            for wire in wires()
            for f in forms
        ),
    ]


def acl(data: bytes) -> None:
    """Check that an accepted text is written to something that is read as the same."""
    message = acl_string.parse(data)
    acl_string.reply_names(message)
    one = acl_string.from_acl(message, 1.76e9)
    again = acl_string.from_acl(acl_string.parse(acl_string.render(acl_string.to_acl(one))), 1.76e9)
    held(again == one, "from_acl(parse(render(to_acl(x)))) is x")


ENVELOPE = Envelope(
    to=(acl_string.Aid("hi@x", ("http://127.0.0.1:8372/acc",)),),
    sender=acl_string.Aid("buyer@lab:1099/JADE", ("http://127.0.0.1:7778/acc",)),
    date=acl_string.At(1_767_225_600_000),
)


def posts() -> list[bytes]:
    """Content type and body of what platforms post, a line between."""
    made = (pack(ENVELOPE, text) for text in ACL_PEERS)
    return [what.encode() + b"\n" + body for what, body in made]


def post(data: bytes) -> None:
    """Check that an envelope that is read is written to one that is read as the same."""
    what, _, body = data.partition(b"\n")
    envelope, text = unpack(what.decode("latin-1"), body)
    held(unpack(*pack(envelope, text)) == (envelope, text), "unpack(pack(x)) is x")


def samples() -> list[bytes]:
    """Key and bytes of what a tap heard."""
    heard = (sampled(one, SYSTEM.design) for one in recorded())
    house = (
        b"roco/roco/_/receipt/co/ta\n" + msgspec.msgpack.encode(Receipt("ta", 3)),
        b"roco/roco/_/alive/co/3\n",
    )
    return [*(one.key.encode() + b"\n" + one.data for one in heard), *house]


def sample(data: bytes) -> None:
    """The recorder makes a record of anything, and an agent an event; any other bytes are named
    garbage.
    """
    key, _, payload = data.partition(b"\n")
    text = key.decode(errors="replace")
    record = understood(Sample(text, payload, 1.76e9, token="/alive/" in text), SYSTEM)
    held(
        isinstance(record, Garbage) or len(text.split("/")) > 3,
        "what has no key of the design is garbage",
    )
    zenoh_wire.arrived(FromWire(text, tuple(text.split("/")[3:]), payload))


# --- files of a run -------------------------------------------------------------------------------


def recordings() -> list[bytes]:
    """Some records of each recording, behind its schemas and channels."""
    made = []
    for run in ("pour_seed_7", "verified_depot"):
        head, found = MCAP.split((HISTORIES / run / "traffic.mcap").read_bytes())
        tables = [one for one in found[:400] if one[:1] in b"\x01\x03\x04"]
        said = [one for one in found if one[:1] == b"\x05" and len(one) < 4000]
        made += [
            MCAP.join(head, [*tables, *said[at : at + 6], found[-1]]) for at in range(0, 300, 10)
        ]
    return made


def recording(path: Path) -> None:
    """Check that all readable parts are read, the rest is a hole, and another recorder goes on
    behind it.
    """
    heard = mcap_file.read(path, SYSTEM)
    history.of_records(heard.records, SYSTEM, whole=heard.whole)
    with suppress(NoRecordingError):
        contents.contents(path)
    second, more = mcap_file.Recording(path), Token("co", 1, True, 1.0)
    second.add(more)
    second.finish()
    again = mcap_file.read(path)
    held(again.whole and again.records[-1] == more, "what is recorded behind damage is read")


@cache
def cores() -> dict[str, Core]:
    """Cores of agents, by name."""
    made = {"co": coordinator.agent(), "ta": task.agent(), "km": knowledge.agent()}
    return {name: Core(agent, wiring(name, "test")) for name, agent in made.items()}


def journals() -> list[bytes]:
    """Journals of agents: of new ones, and of some in the middle of a run."""
    made = []
    for name, core in cores().items():
        steps = steplog.read(HISTORIES / f"verified_pour_seed_7/steps/{name}.steps")
        written = [effects.record for _, effects in steplog.replay(core, steps) if effects.record]
        made += [
            MAGIC + frame(core.record(core.boot(None))),
            *(MAGIC + frame(one) for one in written[::6]),
        ]
        made += [MAGIC + b"".join(map(frame, written[-3:]))]
    return made


def journal(path: Path) -> None:
    """Opened, or refused in words; the agent starts from what is in it, or refuses in words; it can
    be written.
    """
    opened = Journal(path)
    try:
        last = opened.last
        named = (
            core
            for name, core in cores().items()
            if b"\xa5agent\xa2" + name.encode() in (last or b"")
        )
        core = next(named, cores()["co"])
        state = core.boot(last)
        opened.append(core.record(state))
        held(last_record(path.read_bytes()) == opened.last, "what was appended is the last record")
    finally:
        opened.close()


def step_logs() -> list[bytes]:
    """Some lines of each step log."""
    made = []
    for path in sorted(HISTORIES.glob("*/steps/*.steps")):
        head, lines = STEPS.split(path.read_bytes())
        made += [STEPS.join(head, lines[:8]), STEPS.join(head, lines[-8:])]
    return made


def step_log(path: Path) -> None:
    """A report takes what it can; who reads it line by line is told where it is damaged."""
    with tempfile.TemporaryDirectory() as run:
        (Path(run) / "steps").mkdir()
        shutil.copy(path, Path(run) / "steps" / "km.steps")
        tuple(Ends(Path(run), SYSTEM).rest())
    for step in steplog.read(path):
        held(step.apart == 0, "a step that is read has its content")


STEPS, JOURNAL = lengths(0, "<I"), lengths(len(MAGIC), HEAD.format, MARK, checked=True)

# --- an agent's other inputs ----------------------------------------------------------------------


class Moment(msgspec.Struct, frozen=True):
    """State of an agent when something arrived."""

    core: Core
    state: CoreState
    at: float
    wire: bytes


@cache
def moments() -> tuple[Moment, ...]:
    """Agents of a recorded run as they were when each communicate came."""
    made = []
    for name, core in cores().items():
        state = core.boot(None)
        for step in steplog.read(HISTORIES / f"verified_pour_seed_7/steps/{name}.steps"):
            if step.kind == steplog.BOOT:
                state = core.boot(step.input or None)
                continue
            event = steplog.event_of(core, step)
            if isinstance(event, Arrived) and len(event.communicate.content or b"") < 8000:
                made.append(Moment(core, state, step.at, encode(event.communicate)))
            state, _ = core.step(state, event, step.at)
    return tuple(made[:: max(1, len(made) // FEW)])


def to_agents() -> list[bytes]:
    """Two bytes that say which moment, and the communicate that came then."""
    return [number.to_bytes(2, "big") + moment.wire for number, moment in enumerate(moments())]


def agent(data: bytes) -> None:
    """An agent takes any communicate in any state, and can write down and send what follows from
    it.
    """
    one = moments()[int.from_bytes(data[:2], "big") % len(moments())]
    state, event, more = one.state, Arrived(decode(data[2:])), True
    while more:
        state, effects = one.core.step(state, event, one.at)
        held(
            effects.record is None or one.core.boot(effects.record).kept == state.kept,
            "its record is its state",
        )
        for said in effects.sends:
            decode_strictly(encode(said))
        event, more = Next(), effects.more


def orders() -> list[bytes]:
    """One of each order."""
    every = (
        Pause(),
        Resume(),
        SetLevel("debug"),
        SetParameter("attempts", 7),
        SetParameter("slack", 2.5),
    )
    return [msgspec.msgpack.encode(Command(f"console-{n}", order)) for n, order in enumerate(every)]


@cache
def serving() -> tuple[Core, CoreState]:
    """An agent with parameters, after its first step."""
    core = cores()["co"]
    return core, core.step(core.boot(None), Started(first=True), 1.0)[0]


def order(data: bytes) -> None:
    """An agent takes any bytes for an order, and says what became of it."""
    core, state = serving()
    after, _ = core.step(state, zenoh_wire.ordered(data), 2.0)
    restarted = core.boot(core.record(after))
    held(
        restarted.now_set == after.now_set or "nan" in repr(after.now_set),
        "what was set is kept over a restart",
    )


SENTENCES = (
    "pour the jar into the bowl", "take the jar with the left hand",
    "put down the bowl on the table", "look around",
    "status", "cancel", "cancel hi-1-3", "go home", "what do you hold?", "halt",
    "Please, pour jar_1 into bowl_1!",
    "take the jar and pour it into the bowl", "weź słoik lewą ręką", "no", "yes", "the other one",
    "tkae the jar",
)  # fmt: skip


def sentences() -> list[bytes]:
    """Return sentences of a person."""
    return [text.encode() for text in SENTENCES]


def sentence(data: bytes) -> None:
    """Any text is understood, or answered in words."""
    text = data.decode(errors="replace")
    stop_words(text)
    found = interpretation.outcome(grammar.understand(text), interpretation.Context())
    if isinstance(found, interpretation.Act):
        interpretation.in_words(found.tasks)


# --- files people write ---------------------------------------------------------------------------


def designs() -> list[bytes]:
    """Design files: the small ones, and the beginnings of tables of the large ones."""
    return [
        (ROOT / f"tests/topdown/{name}.toml").read_bytes() for name in ("lamp", "grouped", "barrow")
    ]


def checked(path: Path) -> None:
    """Read and checked, whatever it says."""
    check.check(design.load(path))


def scenarios() -> list[bytes]:
    """The depot's, and one of every form."""
    return [(ROOT / "examples/depot/faults.toml").read_bytes(), SCENARIO]


SCENARIO = b"""text = "every form"
[[fault]]
kind = "delay"
target = ["mule", "ox"]
at = [0.0, 5.0]
for = 2.0
amount = [0.05, 0.2]
[[fault]]
kind = "kill"
target = "co"
at = "5th-message"
within = 30.0
"""


def faults(path: Path) -> None:
    """Read, chosen, and said in the words of `roco fault`, all finite."""
    for one in scenario.choose(scenario.load(path), 7):
        scenario.fault_arguments(one, 1.76e9)
        numbers = [one.for_, one.amount, one.within, one.at]
        held(
            all(math.isfinite(x) for x in numbers if isinstance(x, float)),
            "what was chosen is finite",
        )


TARGETS = (
    Target("codec", "communicates and their contents", wires, plain(codec),
           (*BINARY, packed, *[content] * 8),
           (FipaError,), 6.0),
    Target("acl", "ACL text", acl_texts, plain(acl), TEXT, (MalformedError,), 3.0),
    Target("envelope", "envelopes of other platforms", posts, plain(post), TEXT, (MalformedError,)),
    Target("sample", "what a tap hears; what reaches an agent", samples, plain(sample),
           (*BINARY, *TEXT),
           weight=3.0, answers="garbage"),
    Target("agent", "communicates to an agent in the middle of its work", to_agents, plain(agent),
           tuple(behind(2, change) for change in (flip, packed, packed, *[content] * 5)),
           (MalformedError,), 2.0),
    Target("order", "orders to an agent", orders, plain(order), (*BINARY, packed, packed, packed),
           weight=2.0, answers="counted"),
    Target("sentence", "sentences of a person", sentences, plain(sentence), TEXT, weight=2.0,
           answers="a sentence"),
    Target("recording", "recordings", recordings, filed(recording), (*BINARY, *[MCAP.change] * 8),
           answers="left out"),
    Target("journal", "journals", journals, filed(journal), (*BINARY, *[JOURNAL.change] * 5),
           (RuntimeFault,)),
    Target("step_log", "step logs", step_logs, filed(step_log), (*BINARY, *[STEPS.change] * 6),
           (StepLogError,)),
    Target("design", "design files, read and checked", designs, filed(checked), TEXT,
           (TopdownError,), 0.2),
    Target("scenario", "scenarios of faults", scenarios, filed(faults), TEXT, (UsageError,)),
    Target("http", "hi's HTTP service, over a socket", lambda: list(REQUESTS), serving_http, TEXT,
           weight=0.25, answers="status and JSON"),
)  # fmt: skip
