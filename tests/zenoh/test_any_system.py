"""Every verb of `roco` on systems that are not the robot: the depot, from `roco up` to `roco down`,
and a new project.

A copy outside the clone, so that only its pyproject.toml says which system it is. The table below
has a row for every verb that serves any system. One fleet serves all rows in their order; each row
can be called alone, and a second time.
"""

import json
import os
import re
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import depot_fleet
import msgspec
import pytest
from depot_fleet import AGENTS, Project

from console.verbs import GROUP, VERBS
from operate.file_names import LATEST, TRAFFIC_FILE
from operate.recording import mcap_file
from operate.recording.records import Spoken
from operate.reports.report import Report

pytestmark = [pytest.mark.zenoh, pytest.mark.timeout(300)]
RUN = f"runs/{LATEST}"
CHANNELS = ("C2", "C4", "C5", "C6", "C7")
FOREIGN = re.compile(r"\b(hi|co|pl|km|ta|ex|loop|velma|jar|bowl)\b", re.IGNORECASE)
"""Names of the robot's agents and things: where they are told of another system, a tool knows the
robot.
"""
DELIVERED = 3
"""Orders that were carried out before anything is asked."""
ORDER = '{"type":"Carry","item":"crate","source":"store","target":"press"}'
ACL = "(inform :sender (agent-identifier :name ox) :content full)"


class Row(NamedTuple):
    """A call of a verb: its words after the verb, the exit code, and what its output has.

    `up`: whether a fleet runs then, or one has run; None: whichever. `before`: calls without which
    there is nothing to tell of. FRESH stands for the number of the try: each writes elsewhere.
    """

    words: tuple[str, ...] = ()
    code: int = 0
    has: tuple[str, ...] = ()
    up: bool | None = True
    before: tuple[str, ...] = ()


FRESH = "_try_"


CALLS: dict[str, Row] = {
    "status": Row(has=("router", "monitor", *AGENTS, "ready")),
    "agents": Row(has=("router", "monitor", *AGENTS, "MiB")),
    "agents dispatcher": Row(has=("ox on C5", "rounds = 20", "last steps", "says", "log level")),
    "agent restart": Row(("ox",), has=("ox: ready, pid",)),
    "agent stop": Row(
        ("traffic",), has=("traffic: stopped; `roco agent start traffic` starts it",)
    ),
    "agent start": Row(("traffic",), has=("traffic: ready, pid",), before=("agent stop traffic",)),
    "agent repair": Row(
        ("traffic",), code=1, has=("another process holds it; stop that agent first",)
    ),
    "agents --offers": Row(
        ("--long",),
        has=("ox  up (", "cfp job(JOB.Call) -> JOB.Offer or JOB.Carried", "asks traffic: way_ox"),
    ),
    "agent pause": Row(("mule",), has=("mule: paused; `roco agent start mule` lets it go on",)),
    "agent start mule": Row(has=("mule: goes on",), before=("agent pause mule",)),
    "param mule log-level debug": Row(has=("debug",)),
    "param": Row(has=("dispatcher", "rounds", "an integer from 1 to 1000")),
    "param dispatcher rounds": Row(has=("20",)),
    "param dispatcher rounds 30": Row(has=("30",)),
    "fault kill": Row(("ox",), has=("kill ox: begun", "kill ox: back, ")),
    "fault hang": Row(("traffic", "--for", "1"), has=("hang traffic: healed after 1 s",)),
    "fault pause": Row(
        ("mule", "--for", "0.5", "--at", "0.2"), has=("pause mule at 0.2 s: healed after 0.5 s",)
    ),
    "fault restart": Row(("traffic",), has=("restart traffic: back, ",)),
    "fault cut": Row(
        ("ox",), code=1, has=("have no wires; start the fleet with `roco up --faults`",)
    ),
    "fault delay": Row(("ox", "0.1"), code=1, has=("have no wires",)),
    "fault loss": Row(("ox", "0.1"), code=1, has=("have no wires",)),
    "fault rate": Row(("ox", "20000"), code=1, has=("have no wires",)),
    "fault corrupt": Row(("ox", "0.1"), code=1, has=("have no wires",)),
    "fault disk-full": Row(("traffic", "--for", "1"), has=("disk-full traffic: begun",)),
    "fault flood": Row(("mule", "--for", "1"), has=("flood mule by 500: healed after 1 s",)),
    "fault clock": Row(
        ("ox", "-60"), code=1, has=("ox of ", "has no clock of its own; `roco up --faults`")
    ),
    "fault run": Row(
        ("faults.toml", "--seed", "3"),
        has=("pause dispatcher at", "restart traffic at", ": back, "),
    ),
    "fault list": Row(
        has=("kill ox", "pause mule at 0.2 s", "restart traffic", "back"),
        before=("fault kill ox", "fault pause mule --for 0.5 --at 0.2", "fault restart traffic"),
    ),
    "fault heal": Row(has=("no fault goes on",)),
    "logs": Row(("-n", "0"), has=("dispatcher", "ox", "received", "performative=propose")),
    "mcp": Row(code=2, has=("come in by MCP: none",)),
    "a2a": Row(code=2, has=("come in by A2A: none",)),
    "fipa": Row(code=2, has=("come in by FIPA: none",)),
    "view": Row(("--web", "--format", "json"), has=("rerun", '"live":true')),
    "top --graph": Row(("--once",), has=(*AGENTS, *CHANNELS)),
    "top": Row(("--once",), has=("serves tools", *AGENTS, *CHANNELS)),
    "doctor": Row(
        ("--target", RUN, "--format", "json"), has=("8 processes of", '"supervisor"', '"router"')
    ),
    "traffic echo": Row(
        ("--run", RUN, "--count", "8"), has=("desk>dispatcher", "request", "carry", "legal")
    ),
    "trace": Row(("--run", RUN), has=("desk",)),
    "why": Row(("--run", RUN), has=("desk",)),
    "sniff": Row(
        ("--run", RUN, "--count", "9", "--svg", "talk.svg"),
        has=(*AGENTS, "├─", "◀", "C2 carry", "wrote talk.svg: 9 of 9"),
    ),
    "traffic stats hz": Row(("--run", RUN), has=CHANNELS),
    "traffic stats bw": Row(("--run", RUN), has=CHANNELS),
    "traffic stats size": Row(("--run", RUN), has=CHANNELS),
    "traffic stats": Row(("--run", RUN), has=(*CHANNELS, "propose")),
    "traffic dead": Row(("--run", RUN, "--agent", "ox"), has=("dead letter",)),
    "traffic judge": Row((RUN,), has=(*CHANNELS, "legal")),
    "record": Row(
        ("--for", "0.5", "--out", f"part{FRESH}.mcap"),
        has=("communicates", "records", f"part{FRESH}.mcap"),
    ),
    "record info": Row(
        ("--keys",),
        has=("C5/dispatcher/ox/", "house/state", "system depot, design ", "not closed in"),
    ),
    "record repair": Row((RUN,), code=2, has=("is being recorded; `roco down`",)),
    "conversation": Row(("--channel", "C2"), has=("desk > dispatcher", "request")),
    "conversation desk-1-1": Row(has=("desk-1-1  ", " on C2  ", "dispatcher", "agree")),
    "send": Row(("--list", "--as", "ox"), has=("JOB.Offer", "traffic", "C7")),
    "acl show": Row((ACL,), has=("inform", "ox")),
    "runs": Row(has=("depot", "up", "8 processes", "(latest)")),
    "runs --remove": Row(("--keep", "0"), has=("no run is removed",)),  # it is up
    "down": Row(has=("ended forks, router, monitor, desk, dispatcher, traffic, mule, ox",)),
    # What is asked of a run that has ended.
    "replay": Row(
        (RUN, "--replace", "traffic", "--speed", "max"), has=("all of them as recorded",), up=False
    ),
    "report": Row((RUN,), has=(*AGENTS, "report.json"), up=False),
    "export": Row(
        (RUN, "--to", "csv", "--out", f"tables{FRESH}"), has=("communicates.csv",), up=False
    ),
    "compare": Row((RUN, RUN), has=("no regression",), up=False),
    "experiment run": Row(
        ("--for", "3", "--runs", "1", "--out", f"one{FRESH}"),
        has=("1 of 1 runs succeeded", "communicates: ", f"one{FRESH}/report.html"),
        up=False,
    ),
    "chaos": Row(
        (
            "--runs",
            "1",
            "--seed",
            "8",
            "--kind",
            "restart",
            "--on",
            "ox",
            "--out",
            f"disturbed{FRESH}",
        ),
        has=("run 1 of 1, seed 8: restart ox at ", "1 of 1 held", f"disturbed{FRESH}/chaos.jsonl"),
        up=False,
    ),
    "design check": Row(
        ("--estimate",), has=("depot/design.toml: no findings", "5 agents", *CHANNELS), up=None
    ),
    "design diff": Row(
        ("depot/design.toml", "depot/design.toml"), has=("the designs are the same",), up=None
    ),
    "design export": Row(("--promela", f"models{FRESH}"), has=(f"models{FRESH}",), up=None),
    "design follow": Row((RUN,), has=("each a move of the model",), up=False),
    "design new": Row((f"shop{FRESH}",), has=(f"shop{FRESH}/asker/behaviours.py",), up=None),
    "design show": Row(("--what", "system"), has=("desk", "dispatcher"), up=None),
    "design trace": Row(code=1, has=("R3", "delivered"), up=None),  # its tests are in the clone
    "design verify": Row(("--layer", "2"), has=("holds",), up=None),
    "protocol": Row(has=("cfp", "fipa-contract-net", "fipa-request"), up=None),
    "protocol cfp": Row(("--svg", "cfp.svg"), has=("wrote cfp.svg",), up=None),
    "keys make": Row(
        (f"keys{FRESH}",), has=(*AGENTS, "monitor", "console", "operator", "'depot'"), up=None
    ),
    "keys revoke": Row(
        ("traffic", "--keys", f"keys{FRESH}"),
        has=("revoked are traffic",),
        up=None,
        before=(f"keys make keys{FRESH}",),
    ),
}
STARTED = ("up",)
"""Verbs by which there is a fleet."""
VERBS_OF_ANY = [
    words for rows in VERBS.values() for words, (place, _) in rows.items() if place is not GROUP
]


def verb_of(call: str) -> str:
    """The verb that a call begins with: the longest that fits."""
    return max(
        (verb for verb in VERBS_OF_ANY if f"{call} ".startswith(f"{verb} ")), key=len, default=""
    )


CALLS |= {
    verb: Row(up=None) for verb in VERBS_OF_ANY if verb not in (*map(verb_of, CALLS), *STARTED)
}
"""Verbs without a row are called without a word, and succeed."""
HELPS = """
import json, sys
from typer.testing import CliRunner
from console.__main__ import app
said = {verb: CliRunner().invoke(app, [*verb.split(), "--help"]) for verb in sys.argv[1:]}
assert not any(done.exit_code for done in said.values())
print(json.dumps({verb: done.stdout for verb, done in said.items()}))
"""


class Depot(depot_fleet.Depot):
    """The depot, with a fleet when one is wanted."""

    def __init__(self, folder: Path) -> None:
        super().__init__(folder)
        self.up: bool | None = None  # none has run yet
        self.made = set[str]()  # calls since it is up
        self.tries = Counter[str]()

    def wants(self, up: bool) -> None:
        """Have a fleet in the background, with some orders carried out; or have one ended."""
        if self.up is None or (up and not self.up):
            self.made.clear()
            said, self.up = self.roco("up"), True
            assert f"ready; everything is written to {self.folder}/runs" in said
        if self.up:
            self.wait(lambda: self.said("delivered ") >= DELIVERED, "orders are delivered")
        if self.up and not up:
            self.end()
            self.up = False

    def call(self, verb: str) -> "tuple[Row, subprocess.CompletedProcess[str]]":
        """Call a verb as its row says; return the row of this try, and what came of it."""
        row, self.tries[verb] = CALLS[verb], self.tries[verb] + 1
        fresh, again = f"_{self.tries[verb]}", self.tries[verb] > 1
        if row.up is not None:
            self.wants(row.up)
        for before in (one.replace(FRESH, fresh) for one in row.before):
            if again or before not in self.made:
                self.called(before)
        words, has = (
            tuple(one.replace(FRESH, fresh) for one in some) for some in (row.words, row.has)
        )
        done = self.called(verb, *words)
        self.made.add(" ".join((verb, *words)))
        self.up = self.up and verb != "down"
        return row._replace(words=words, has=has), done


@pytest.fixture(scope="module")
def depot(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Depot]:
    """A copy of the depot."""
    made = Depot(tmp_path_factory.mktemp("any"))
    yield made
    made.end()


def right(row: Row, done: "subprocess.CompletedProcess[str]", folder: Path) -> None:
    """A call came out as its row says, and told nothing of the robot."""
    said = done.stdout + done.stderr
    assert done.returncode == row.code, said
    assert [words for words in row.has if words not in said] == [], said
    assert FOREIGN.findall(said.replace(str(folder), "")) == [], said


def test_every_row_is_of_a_verb() -> None:
    """One that was renamed leaves none behind."""
    assert {*map(verb_of, CALLS), *STARTED} == set(VERBS_OF_ANY)


@pytest.mark.parametrize("verb", CALLS)
def test_a_verb_tells_of_the_system_that_runs(depot: Depot, verb: str) -> None:
    """Its agents and channels, and nothing of the robot."""
    right(*depot.call(verb), depot.folder)


def test_other_users_read_nothing_of_a_run(depot: Depot) -> None:
    """Keys, journals, recording: what TLS hides on the network is not open on the disk."""
    depot.wants(up=False)
    for place in (depot.run, depot.run / "traffic.mcap"):
        assert place.stat().st_mode & 0o077 == 0


def test_every_agent_of_the_run_is_run_again_to_the_same_bytes(depot: Depot) -> None:
    """Also those that were restarted, stopped, paused and set by the calls above."""
    depot.wants(up=False)
    said = depot.roco("replay", RUN, "--verify")
    assert [one for one in AGENTS if not re.search(rf"^{one} +[1-9]", said, re.MULTILINE)] == []
    assert "5 agents, " in said
    assert "each put out the same bytes as then" in said


AGAIN = """
import sys
from pathlib import Path
from operate.reports.make import everything
from operate.system import of_run
from operate.recording.run import Run
run = Path(sys.argv[1])
assert everything(Run(run, of_run(run)), lambda *_, **__: None)
ours = ("companion", "velma", "services")
print([name for name in sys.modules if name.partition(".")[0] in ours])
"""


def test_the_report_counts_what_was_recorded_and_needs_nothing_of_the_companion(
    depot: Depot,
) -> None:
    """Communicates per pair, all as designed; the page names every agent. It is made again by a
    process that imports nothing of the robot.
    """
    depot.wants(up=False)
    run, environment = depot.run.resolve(), os.environ | {"PYTHONSAFEPATH": "1"}
    done = subprocess.run(
        [sys.executable, "-c", AGAIN, str(run)],
        env=environment, capture_output=True, text=True, timeout=100,
    )  # fmt: skip
    assert done.stdout.strip() == "[]", done.stderr
    assert (run / "run.rrd").stat().st_size
    told = msgspec.json.decode((run / "report.json").read_bytes(), type=Report)
    records = mcap_file.read(run / TRAFFIC_FILE).records
    said = {one.identity for one in records if isinstance(one, Spoken)}
    matrix = told.communicates.matrix
    counted = {(s, r): n for s, row in matrix.items() for r, n in row.items() if n}
    assert counted == Counter((sender, receiver) for sender, receiver, _ in said)
    assert counted["desk", "dispatcher"]
    assert {one.agent for one in told.busy} == {*AGENTS}
    page = (run / "report.html").read_text()
    assert all(f"<th>{agent}</th>" in page for agent in AGENTS)
    assert "jar" not in page
    assert "paper" not in page


def test_what_only_the_robot_can_do_is_no_verb_here(depot: Project) -> None:
    """Neither listed nor called: wrong use, which names what there is."""
    listed = depot.roco("--help")
    assert "conversation" in listed
    assert not re.search(r"^│ (say|stop|demo) ", listed, re.MULTILINE)
    done = depot.called("say", "pour", "--format", "json")
    assert (done.returncode, done.stdout) == (2, "")
    assert (
        "depot, has no verb 'say'; there are up, down, status" in json.loads(done.stderr)["error"]
    )


def test_help_has_examples_of_that_system(depot: Project) -> None:
    """With names of its design, none of the robot's. In one process: most of such a call is the
    start of Python.
    """
    command = [sys.executable, "-P", "-c", HELPS, *VERBS_OF_ANY]
    where, environment = depot.folder, depot.environment
    done = subprocess.run(
        command, cwd=where, env=environment, capture_output=True, text=True, timeout=100
    )
    assert done.returncode == 0, done.stderr
    wrong = []
    for verb, said in json.loads(done.stdout).items():
        foreign, names = FOREIGN.findall(said.replace("--loop", "")), said.partition("Examples:")[2]
        if f"roco {verb}" not in said or foreign or re.search("AGENT|PEER|CHANNEL", names):
            wrong.append((verb, foreign, said))
    assert not wrong


def test_a_filter_knows_the_names_of_that_design(depot: Depot) -> None:
    """Of a recording by its folder's fleet.json, so that it can be asked anywhere."""
    depot.wants(up=False)
    away, echo = Project(depot.folder.parent), ("traffic echo --run", str(depot.run), "--agent")
    refused = away.roco(*echo, "km", code=2)
    assert "the design has no agent 'km'; it has desk, dispatcher, traffic, mule, ox" in refused
    assert "ox>traffic" in away.roco(*echo, "ox")


def test_a_new_project_is_operated_at_once(tmp_path: Path) -> None:
    """`roco design new`, then the verbs in its folder, with nothing written by hand."""
    Project(tmp_path).roco("design new shop")
    shop = Project(tmp_path / "shop")
    expected = {
        "design check": Row(has=("no findings", "2 agents")),
        "up": Row(has=("ready; everything is written to",)),
        "status": Row(has=("asker", "doer", "ready")),
        "top --graph --once": Row(has=("asker", "doer", "C1")),
        "agents": Row(has=("asker", "doer", "MiB")),
        "traffic dead": Row(("--run", RUN, "--agent", "doer"), has=("dead letter",)),
        # its stubs say nothing yet
        "traffic judge": Row((RUN,), code=2, has=("has no communicates to judge",)),
        "send": Row(("--list",), has=("asker", "doer")),
        "runs": Row(has=("shop", "up", "5 processes", "(latest)")),
        "runs --remove": Row(("--keep", "0"), has=("no run is removed",)),  # it is up
        "down": Row(has=("ended forks, router, monitor, asker, doer",)),
    }
    try:
        for verb, row in expected.items():
            right(row, shop.called(verb, *row.words), tmp_path)
    finally:
        shop.end()
