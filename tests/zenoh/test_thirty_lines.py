"""A new agent in the example: a step more in the design, `new`, at most 30 lines, and it answers
over Zenoh.
"""

import difflib
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import msgspec
import pytest
import zenoh
from depot_fleet import DESIGN_FILE, copied
from toy_fleet import wait_for

from agent_runtime.io.sessions import client_config
from fipa_codec.communicate import Communicate, encode
from fipa_codec.languages import Language
from fipa_codec.performatives import Performative as P
from operate.fleet_file import Fleet
from topdown.check import check
from topdown.model import loading
from topdown.model.design import Design
from topdown.scaffold import scaffold

EXAMPLE = Path(__file__).parents[2] / "examples" / "depot"
pytestmark = pytest.mark.zenoh
MOST_LINES = 30

REQUIREMENT = """
[[requirement]]
id = "R7"
parent = "R1"
text = "say what a transport costs"

# --- the steps"""
STEP = """
[[step]]
requirements = ["R7"]
divide = { group = "office", into = ["bureau", "tariff"] }
tasks = [
  { group = "bureau", text = "orders and their transport" },
  { group = "tariff", text = "knows what a transport costs" },
]
reallocate = [{ channel = "C1", to = "bureau" }]
channels = [{ id = "C8", between = ["bureau", "tariff"], transmits = "questions about prices" }]
stop = [{ group = "tariff", reason = "a price is one computation" }]

[[step]]
requirements = ["R2", "R3"]
divide = { group = "bureau", into = ["desk", "dispatcher"] }"""
MOVED = 'reallocate = [{ channel = "C1", to = "dispatcher" }, { channel = "C8", to = "desk" }]'
USE = """
[[language]]
name = "PRICE"
text = "what transports cost"

[[interface]]
name = "prices"
entries = [["query-ref", "price", ["PRICE.PriceOf"], ["PRICE.Price"]]]

[[protocol]]
name = "price"
channel = "C8"
follows = "query"
initiator = "desk"
participant = "tariff"
interface = ["prices"]
durable = false
latency_s = 0.5

[[protocol.message]]
sender = "desk"
performative = "query-ref"
language = "PRICE"
content = ["PriceOf"]
bytes = 250

[[protocol.message]]
sender = "tariff"
performative = "inform"
language = "PRICE"
content = ["Price"]
bytes = 250

[[protocol.message]]
sender = "tariff"
performative = "refuse"
language = "PRICE"
bytes = 250
"""
ASKING = """
[[agent.row]]
in = ["listening", "waiting"]
on = "person question"
say = ["price query-ref"]

[[agent.row]]
in = ["listening", "waiting"]
on = "price inform"

[[agent.row]]
in = ["listening", "waiting"]
on = "price refuse"

[[agent.row]]
in = ["listening", "waiting"]
on = "late price"
"""
TARIFF = """
[[agent]]
name = "tariff"
text = "says what a transport costs"
initial = "open"

[[agent.state]]
name = "open"
behaviour = "quote"
terminal = "closed"
talks = ["price"]
text = "waits for a question"

[[agent.arc]]
source = "open"
target = "open"

[[agent.row]]
in = ["open"]
on = "price query-ref"
say = ["price inform"]

[[agent.row]]
in = ["open"]
on = "price query-ref"
say = ["price refuse"]
"""
DESIGNED = (
    ("\n# --- the steps", REQUIREMENT),
    (
        (
            '\n[[step]]\nrequirements = ["R2", "R3"]\ndivide = { group = "office", into = ["desk",'
            ' "dispatcher"] }'
        ),
        STEP,
    ),
    ('reallocate = [{ channel = "C1", to = "dispatcher" }]', MOVED),
    ("\n# --- agents: states", USE + "\n# --- agents: states"),
    ('\n[[agent]]\nname = "dispatcher"', ASKING + '\n[[agent]]\nname = "dispatcher"'),
    ('\n[[agent]]\nname = "traffic"', TARIFF + '\n[[agent]]\nname = "traffic"'),
    ('talks = ["watch"]', 'talks = ["watch", "price"]'),
)

FILLED = {
    "languages/price.py": (
        (
            'class PriceOf(Sentence, frozen=True):\n    """Query-ref of desk in price."""\n',
            "\n    source: str\n    target: str\n",
        ),
        (
            'class Price(Sentence, frozen=True):\n    """Inform of tariff in price."""\n',
            "\n    euro: float\n",
        ),
    ),
    "tariff/behaviours.py": (
        (
            "from agent_runtime.core.turn import Turn\n",
            (
                "from agent_runtime.core.events import Received\nfrom fipa_codec.performatives"
                " import Performative as P\n"
            ),
        ),
        (
            "from depot.design import DESIGN\n",
            (
                "from depot.languages.price import Price, PriceOf\nfrom depot.world import"
                " STATIONS, length, way\n"
            ),
        ),
        (
            '    - on price query-ref: say price refuse\n    """\n',
            """    match turn.event:
        case Received(content=PriceOf(source=source, target=target)) as asked:
            if not {source, target} <= STATIONS.keys():
                turn.say(asked.conversation, P.REFUSE)
            else:
                euro = round(5.0 + 0.5 * length(way(STATIONS[source], target)), 2)
                turn.say(asked.conversation, P.INFORM, Price(euro))
    return memory
""",
        ),
    ),
}
STUB = '    return unfilled(memory, turn, "quote")  # to fill in\n'


def designed() -> str:
    """The example's design with one agent more."""
    text = DESIGN_FILE.read_text()
    for old, new in DESIGNED:
        assert old in text, old
        text = text.replace(old, new)
    return text


def filled(folder: Path) -> int:
    """Fill in the new agent; how many lines that took."""
    lines = 0
    for path, parts in FILLED.items():
        target = folder / "depot" / path
        before = after = target.read_text()
        for behind, more in parts:
            assert behind in after, behind
            after = after.replace(behind, behind + more)
        after = after.replace(STUB, "").replace(
            "from agent_runtime.core.agent import unfilled\n", ""
        )
        lines += sum(
            line.startswith("+ ") for line in difflib.ndiff(before.splitlines(), after.splitlines())
        )
        target.write_text(after)
    return lines


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    """The example, with the new agent made and filled in."""
    folder = copied(tmp_path / "depot")
    outcome = scaffold(designed(), folder)
    assert "depot/tariff/behaviours.py" in outcome.written
    assert all(kept.path.partition("/")[2].partition("/")[0] != "tariff" for kept in outcome.kept)
    return folder


@pytest.fixture
def running(copy: Path, tmp_path: Path) -> Iterator[tuple[Path, Path]]:
    """All six agents, linked with each other; the file with what they say, and the run's folder."""
    assert filled(copy) <= MOST_LINES
    run, out = tmp_path / "run", tmp_path / "out"
    (tmp_path / "none.toml").write_text("")
    command = [sys.executable, "-m", "depot", "--run-dir", str(run), "--scene"]
    with out.open("wb") as file:
        process = subprocess.Popen(
            [*command, str(tmp_path / "none.toml")], cwd=copy, stdout=file, stderr=file
        )
    yield out, run
    process.send_signal(signal.SIGINT)
    assert process.wait(30.0) == 0


def test_the_grown_design_is_consistent() -> None:
    """The step is one of the method: nothing is found."""
    assert check(Design(loading.read(designed()))) == ()


def test_the_new_agents_own_tests_pass(copy: Path) -> None:
    """Before it is filled in and after: it binds, and answers what it is asked."""
    words = ("-m", "pytest", "-q", "-p", "no:cacheprovider", "tests/test_tariff.py")
    for step in (lambda: 0, lambda: filled(copy)):
        assert step() <= MOST_LINES
        done = subprocess.run(
            [sys.executable, *words], cwd=copy, capture_output=True, text=True, timeout=30
        )
        assert done.returncode == 0, done.stdout


def test_a_new_agent_answers_after_at_most_thirty_lines(running: tuple[Path, Path]) -> None:
    """Asked as its peer would ask, at its endpoint, the tariff says a price by the length of the
    way.
    """
    out, run = running
    wait_for(lambda: "all ready" in out.read_text(), "six agents are ready")
    asked = {"type": "PriceOf", "source": "receiving", "target": "press"}
    question = Communicate(
        performative=P.QUERY_REF, content=Language("PRICE", dict).encode(asked), language="PRICE",
        protocol="query", reply_with="q1", conversation="desk-9-1", sender="desk",
        receiver="tariff", id="q1",
    )  # fmt: skip
    fleet = msgspec.json.decode((run / "fleet.json").read_bytes(), type=Fleet)
    with zenoh.open(client_config(fleet.agents["tariff"])) as session:
        session.put("roco/depot/C8/desk/tariff/query/query-ref", encode(question))
        wait_for(lambda: "tariff -> desk  inform  Price(euro=8.04)" in out.read_text(), "a price")
