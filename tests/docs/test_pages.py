"""Pages of docs/ name what there is, and show figures as the code and the results have them."""

import ast
import importlib.util
import re
from collections.abc import Iterator
from enum import StrEnum
from pathlib import Path
from typing import Any

import house
import msgspec
import pytest
import writers
import yaml

from agent_runtime.io.inbox import BOUNDS, Class
from companion.run_files import HiEvent, Question, Say, TaskLine, Tasks, Wish
from console.faults import verbs as faults
from console.faults.kinds import KINDS, VERBS
from operate.experiments.run_figures import SentMessage
from operate.reports.report import Busy
from operate.ros.telling import Telling
from operate.system import here
from operate.verdict_lines import Dead
from topdown.judge.verdicts import Verdict
from velma.model.kinds import Model
from velma.model.scene import CANONICAL, MOST_NOISE, Noise, Spread, load, vary
from velma.sim.mujoco_backend import MujocoBackend

ROOT = Path(__file__).parents[2]


# --- docs/architecture.md: the rooms, and who writes an agent's state -----------------------------


def test_the_picture_is_that_of_the_code() -> None:
    """After a change of the imports between rooms: scripts/figures."""
    text = house.PAGE.read_text(encoding="utf-8")
    assert text == house.page(text)


def test_every_room_of_the_code_is_in_the_picture() -> None:
    """A new room cannot be forgotten."""
    assert {room for edge in house.edges() for room in edge} == set(house.ROOMS)


def test_the_table_of_writers_is_that_of_the_code() -> None:
    """After a change of agent_runtime.core: scripts/figures."""
    text = writers.PAGE.read_text(encoding="utf-8")
    assert text == writers.page(text)


def test_every_field_has_a_writer_but_the_name_of_the_agent() -> None:
    """A way to write a field that the script does not know leaves that field without one."""
    assert {field for field, by in writers.writers().items() if not by} == {"agent"}


# --- docs/delivery.md: each promise names a test, and each test it names exists -------------------


NAMED = re.compile(r"`([\w/]+\.py)::(\w+)`")


def promises() -> list[str]:
    """Return the sentences of the lists, up to what is not promised."""
    page = (ROOT / "docs/delivery.md").read_text().partition("## Not promised")[0]
    return re.findall(r"^- (.*?)(?=\n- |\n\n|\Z)", page, re.MULTILINE | re.DOTALL)


def test_each_promise_names_its_test() -> None:
    """A promise that nothing holds is none."""
    assert len(promises()) > 15
    assert [one for one in promises() if not NAMED.search(one)] == []


def test_each_test_named_exists() -> None:
    """Under that name, in that file."""
    named = [match for one in promises() for match in NAMED.findall(one)]
    missing = [
        (file, test)
        for file, test in named
        if not (ROOT / "tests" / file).is_file()
        or f"def {test}(" not in (ROOT / "tests" / file).read_text()
    ]
    assert missing == []


# --- docs/glossary.md names what is in the code ---------------------------------------------------


ROWS = [
    [cell.strip() for cell in line.strip("|\n").split("|")]
    for line in (ROOT / "docs/glossary.md").read_text().splitlines()
    if line.startswith("| ") and not line.startswith("| word ")
]


def names(path: Path) -> Iterator[str]:
    for node in ast.walk(ast.parse(path.read_bytes())):
        if isinstance(node, ast.ClassDef):
            yield node.name


def file_of(module: str) -> Path | None:
    path = module.replace(".", "/") + ".py"
    return next(
        (folder / path for folder in (ROOT / "shared", ROOT) if (folder / path).exists()), None
    )


def test_what_the_glossary_names_is_in_the_code() -> None:
    wrong = []
    for word, _, symbol in ROWS:
        module, _, name = symbol.strip("`").rpartition(".")
        file = file_of(module)
        if symbol and (file is None or name not in names(file)):
            wrong.append(f"{word}: {symbol}")
    assert len(ROWS) >= 30
    assert wrong == []


# --- docs/results/faults.md: its tables are those of the results ----------------------------------


def script(name: str) -> Any:
    """Return a script of benchmarks/ as a module."""
    found = importlib.util.spec_from_file_location(name, ROOT / f"benchmarks/{name}.py")
    assert found is not None
    assert found.loader is not None
    module = importlib.util.module_from_spec(found)
    found.loader.exec_module(module)
    return module


def lines(of: Any) -> list[dict[str, Any]]:
    """Return the results of a script."""
    return [msgspec.json.decode(line) for line in of.RESULTS.read_bytes().splitlines()]


@pytest.mark.parametrize("name", ["fault_table", "coming_back", "soak", "kill_boundaries", "fuzz"])
def test_the_tables_are_those_of_the_results(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """`python benchmarks/NAME.py --table` writes them."""
    monkeypatch.syspath_prepend(ROOT / "benchmarks")
    monkeypatch.syspath_prepend(ROOT / "tests/fuzz")
    monkeypatch.syspath_prepend(ROOT / "tests/fleet")
    made = script(name)
    assert f"{made.BEGIN}{made.printed(lines(made))}{made.END}" in made.PAGE.read_text(
        encoding="utf-8"
    )


def test_the_tables_of_disturbances_are_those_of_the_results(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """As above, with noise and with disturbances."""
    monkeypatch.syspath_prepend(ROOT / "benchmarks")
    pours, disturbed = script("pour_one_process"), script("disturbed")
    page = pours.PAGE.read_text(encoding="utf-8")
    results = disturbed.RESULTS.with_name("pour_one_process.jsonl").read_bytes().splitlines()
    table = "".join(pours.rows(list(map(msgspec.json.decode, results))))
    assert f"{pours.BEGIN}{table}{pours.END}" in page
    newest = {disturbed.key(line): line for line in lines(disturbed) if "act" in line}
    table = "\n".join(disturbed.printed(list(newest.values()))) + "\n"
    assert f"{disturbed.BEGIN}{table}{disturbed.END}" in page


def test_the_tables_of_the_eyes_are_those_of_the_results(monkeypatch: pytest.MonkeyPatch) -> None:
    """`python benchmarks/eyes.py --page docs/results/eyes.md` writes them."""
    monkeypatch.syspath_prepend(ROOT / "benchmarks")
    made, page = script("eyes"), (ROOT / "docs/results/eyes.md").read_text(encoding="utf-8")
    assert f"{made.BEGIN}{made.table(lines(made))}{made.END}" in page


def test_the_table_of_afternoons_is_that_of_the_results(monkeypatch: pytest.MonkeyPatch) -> None:
    """`python benchmarks/afternoon.py --table` writes it."""
    monkeypatch.syspath_prepend(ROOT / "benchmarks")
    made = script("afternoon")
    assert f"{made.BEGIN}{made.printed()}{made.END}" in made.PAGE.read_text(encoding="utf-8")


@pytest.mark.parametrize("name", ["fault_table", "soak", "kill_boundaries", "fuzz"])
def test_the_summary_has_the_figures_of_the_results(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The first number of each table stands in docs/reliability.md, too."""
    monkeypatch.syspath_prepend(ROOT / "benchmarks")
    monkeypatch.syspath_prepend(ROOT / "tests/fuzz")
    monkeypatch.syspath_prepend(ROOT / "tests/fleet")
    made = script(name)
    first = re.findall(r"[\d,]*\d", made.printed(lines(made)))[0]
    assert re.search(rf"\b{first}\b", (ROOT / "docs/reliability.md").read_text(encoding="utf-8"))


def test_a_fault_is_tried_again_only_where_it_had_failed(monkeypatch: pytest.MonkeyPatch) -> None:
    """A cell that poured stands once, so that no lucky run takes the place of another one."""
    monkeypatch.syspath_prepend(ROOT / "benchmarks")
    poured = set()
    for line in lines(script("fault_table")):
        cell = (line["fault"], line["victim"], line["phase"])
        assert cell not in poured, cell
        poured |= {cell} if line["poured"] else set()


# --- docs/experiments.md: its tables of columns ---------------------------------------------------


@pytest.mark.parametrize(("table", "kind"), [("communicates", SentMessage), ("states", Busy)])
def test_a_table_of_an_export_has_the_columns_of_the_code(
    table: str, kind: type[msgspec.Struct]
) -> None:
    """In their order."""
    page = (ROOT / "docs/experiments.md").read_text(encoding="utf-8")
    (row,) = re.findall(rf"^\| `{table}` \|.*\|(.*)\|$", page, re.MULTILINE)
    assert tuple(re.findall(r"`(\w+)`", row)) == kind.__struct_fields__


# --- docs/faults.md: its table has each kind of fault, with its amount and its time ---------------


FAULTS = (ROOT / "docs/faults.md").read_text(encoding="utf-8")


def test_the_table_of_faults_is_that_of_the_code() -> None:
    """Each kind with the amount that it needs and the time after which it is healed."""
    rows = re.findall(r"^\| `(\S+) (PROCESS|AGENT)(?: (\w+))?` \|.*\| ([^|]*) \|$", FAULTS, re.M)
    assert [row[0] for row in rows] == sorted(VERBS, key=[row[0] for row in rows].index)
    for name, on, amount, ends in rows:
        kind = KINDS[name]
        needs = kind.amount is not None and not kind.amount.option
        assert amount == (kind.amount.metavar if needs and kind.amount else ""), name
        assert kind.agents == (on == "AGENT"), name
        assert f"({kind.for_s:g} s)" in ends if kind.for_s else "--for` (" not in ends, name


def test_an_example_of_a_scenario_can_be_read(tmp_path: Path) -> None:
    """That of the page, as a file."""
    (found,) = re.findall(r"```toml\n(.*?)```", FAULTS, re.DOTALL)
    (tmp_path / "faults.toml").write_text(found, encoding="utf-8")
    assert faults.load(tmp_path / "faults.toml").fault[0].times == 15


# --- docs/scenes.md: its example can be started, its tables name what there is --------------------


SCENES = (ROOT / "docs" / "scenes.md").read_text("utf-8")


@pytest.fixture
def example(tmp_path: Path) -> Path:
    """The scene of the page, as a file."""
    (found,) = re.findall(r"```toml\n(.*?)```", SCENES, re.DOTALL)
    path = tmp_path / "example.toml"
    path.write_text(found, "utf-8")
    return path


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_the_example_can_be_started(example: Path, seed: int) -> None:
    """As it is written and varied."""
    assert MujocoBackend(vary(load(example), seed)).observe().time == 0.0


def test_the_jar_can_be_moved_as_the_page_says(tmp_path: Path) -> None:
    """On its shelf and onto the table: the scenes can be started."""
    text = CANONICAL.read_text("utf-8")
    start = text.index('id = "jar_1"')
    moved, on_table = re.findall(r"xyz = \[[\d., -]+\]", SCENES.partition("## The file")[0])
    placed = 'on = "table_1"'
    assert placed in SCENES.partition("## The file")[0]
    for xyz, where in ((moved, 'inside = "cabinet_2"'), (on_table, placed)):
        jar = re.sub(r"xyz = \[.*?\]", xyz, text[start:], count=1)
        jar = jar.replace('inside = "cabinet_2"', where, 1)
        path = tmp_path / "mine.toml"
        path.write_text(text[:start] + jar, "utf-8")
        assert MujocoBackend(load(path)).observe().time == 0.0


def test_every_model_and_every_scene_of_ours_is_named() -> None:
    """In the tables of the page."""
    assert {str(model) for model in Model} <= set(re.findall(r"`(\w+)`", SCENES))
    assert {path.stem for path in CANONICAL.parent.glob("*.toml")} <= set(
        re.findall(r"`(\w+)`", SCENES)
    )


# --- docs/run-folder.md lists the files that the code names, and no others ------------------------


CODE = [path for room in ("shared", "services") for path in sorted((ROOT / room).rglob("*.py"))]
FILES = re.compile(
    r"^(?:\w+_FILES?|\w+_FOLDER|\w*SUFFIX|MEMORY|STEPS|PAGE_KEYS)(?:, SUFFIX)? = (.*)$",
    re.MULTILINE,
)
"""Constants that name a file, a folder, or the end of a file's name."""
ELSEWHERE = {
    "chaos.jsonl", "communicates.parquet", "experiment.json", "pyproject.toml", "results.jsonl",
    "run.log", "runs.parquet", "Foxglove", "explore",
}  # fmt: skip
"""Files of experiments, of `roco chaos` and of projects; a word; a library in C."""


def listed(page: str, heading: str) -> list[str]:
    """Return what stands in backquotes at the head of each item of the lists of a section."""
    section = (ROOT / page).read_text("utf-8").partition(f"\n## {heading}")[2].partition("\n## ")[0]
    heads = re.findall(r"^- ((?:`[^`]+`(?:, )?)+)", section, re.MULTILINE)
    return [word for head in heads for word in re.findall(r"`(.*?)`", head)]


def test_every_file_of_a_run_folder_is_listed() -> None:
    """A new constant of a file needs an item."""
    rows = " ".join(listed("docs/run-folder.md", "Files"))
    named = {
        name
        for path in CODE
        for line in FILES.findall(path.read_text("utf-8"))
        for name in re.findall(r'"([\w.-]+)"', line)
    }
    assert len(named - ELSEWHERE) > 25
    assert {name for name in named - ELSEWHERE if name not in rows} == set()


def test_no_listed_file_is_unknown_to_the_code() -> None:
    """By its name, or by the end of a name that has the process's in front."""
    code = "\n".join(path.read_text("utf-8") for path in CODE)
    ends = [
        name.rpartition("<")[2].rpartition(">")[2] for name in listed("docs/run-folder.md", "Files")
    ]
    assert len(ends) > 30
    made = {"fipa.json", "fipa.journal"}  # NAME of console.fleet.platforms, and an ending
    assert {end for end in ends if end.strip("./") not in code} - made == set()


# --- docs/report.md lists the fields of report.json -----------------------------------------------


def test_every_field_of_a_report_is_listed() -> None:
    """And the list has no others."""
    from companion.tools.report.report import Report

    rows = {re.sub(r"\W", "", name) for name in listed("docs/report.md", "report.json")}
    assert rows | {"missing"} == set(Report.__struct_fields__)  # missing: above the list


# --- docs/roco.md lists the checks of `roco doctor` -----------------------------------------------


CHECKUPS = ("shared/console/fleet/checkup.py", "shared/companion/tools/verbs/checkup.py")


def test_every_check_of_doctor_is_in_the_list() -> None:
    """Those whose name is written in the code."""
    named = {
        call.args[0].value
        for file in CHECKUPS
        for call in ast.walk(ast.parse((ROOT / file).read_bytes()))
        if isinstance(call, ast.Call)
        and isinstance(call.func, ast.Name)
        and call.func.id in ("fine", "note", "wrong", "Check")
        and isinstance(call.args[0], ast.Constant)
    }
    assert len(named) > 18
    assert named - set(listed("docs/roco.md", "Diagnosis")) == set()


# --- docs/saying.md: its examples are understood --------------------------------------------------


SAYING = (ROOT / "docs/saying.md").read_text("utf-8").partition("## Accuracy")[0]
EXAMPLES = [
    (row, sentence)
    for row, *cells in re.findall(r"^\| (\w[\w ]*) \| (.*?) \| (.*?) \|$", SAYING, re.MULTILINE)
    for cell in cells
    for sentence in re.findall(r"[^;?]+", re.sub(r" \([^)]*\)", "", cell))
    if row != "wish" and sentence != "-"
]


@pytest.mark.parametrize(("row", "sentence"), EXAMPLES)
def test_an_example_of_a_sentence_is_understood(row: str, sentence: str) -> None:
    """As one wish, without a stop word; in the rows `stop` and `help` by a stop word."""
    from companion.stop_words import stop_words
    from services.human_interface.grammar import understand

    stops = bool(stop_words(sentence))
    assert stops == (row in ("stop", "help"))
    assert stops or [one.does for one in understand(sentence).clauses] not in ([], ["the"])


# --- docs/http.md names every field that hi's clients send or get ---------------------------------


HTTP = (ROOT / "docs/http.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("kind", [Say, TaskLine, Tasks, HiEvent, Wish, Question], ids=str)
def test_each_field_is_in_the_page(kind: type[msgspec.Struct]) -> None:
    """A field that is added cannot be forgotten."""
    named = set(re.findall(r"`(\w+)`", HTTP))
    assert set(kind.__struct_fields__) <= named


# --- docs/ros.md names every topic ----------------------------------------------------------------


def test_each_topic_of_ros_is_in_the_page() -> None:
    """A topic that is added cannot be forgotten; none is there that nobody tells."""
    rows = re.findall(r"^\| (`/.*?) \|", (ROOT / "docs/ros.md").read_text("utf-8"), re.MULTILINE)
    named = {name for row in rows for name in re.findall(r"`(/[\w/]+)`", row)}
    told = {topic.name for topic in Telling(here(ROOT), lambda _: None).topics}
    ours = {name for name in named if not name.startswith("/foxglove/")}
    assert {re.sub("/C[0-9]+$|/G[0-9]+$", "/C1", name) for name in told} == ours


# --- docs/conversations.md and docs/traffic.md: tables have every verdict and every reason --------


@pytest.mark.parametrize(
    ("page", "head", "kind"),
    [("conversations.md", "verdict", Verdict), ("traffic.md", "reason", Dead)],
)
def test_each_word_has_its_row(page: str, head: str, kind: type[StrEnum]) -> None:
    """And no other."""
    text = (ROOT / "docs" / page).read_text(encoding="utf-8")
    table = text.partition(f"| {head} |")[2].partition("\n\n")[0]
    assert sorted(re.findall(r"^\| ([a-z ]+) \|", table, re.MULTILINE)) == sorted(kind)


# --- docs/deploy.md: services and settings are those of the compose files -------------------------


DEPLOY = (ROOT / "docs/deploy.md").read_text(encoding="utf-8")
COMPOSE = [(ROOT / f"deploy/compose{one}.yaml").read_text() for one in ("", ".fipa", ".rt")]


def first_cells(heading: str) -> list[tuple[str, str]]:
    """The names in the first and the words of the second column of a section's table."""
    section = DEPLOY.partition(f"\n## {heading}\n")[2].partition("\n## ")[0]
    return re.findall(r"^\| ([^|]+?) \| ([^|]*?) ?\|", section, re.MULTILINE)[1:]


def test_each_service_has_its_row() -> None:
    """With the image that is built for it."""
    rows = {name: image for names, image in first_cells("Services") for name in names.split(", ")}
    built = {
        name: re.sub(r"\$\{\w+:-(\w+)\}", r"\1", one["build"]["target"])
        for text in COMPOSE
        for name, one in yaml.safe_load(text)["services"].items()
        if "build" in one
    }
    assert rows == built


def test_each_setting_has_its_row() -> None:
    """With the default that the compose files have."""
    rows: dict[str, str] = {}
    for cell, defaults in first_cells("Settings"):
        names = re.findall(r"\w+", cell)
        rows |= dict(
            zip(names, defaults.split(", ") if defaults else [""] * len(names), strict=True)
        )
    found: dict[str, str] = {}
    for text in COMPOSE:
        found.update(re.findall(r"\$\{(\w+):-([^}]*)\}", text))
    assert rows == found


# --- docs/threats.md: the bounds of a flood are those of an agent's inbox -------------------------


def test_the_bounds_of_a_flood_are_those_of_the_inbox() -> None:
    """How many wait, and how many are taken in a second."""
    page = (ROOT / "docs/threats.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| [a-z, ]+ \| ([\d,]+) \| ([\d,]+) \|$", page, re.MULTILINE)
    classes = (Class.STREAM, Class.CONTROL, Class.VOLATILE, Class.LIFE)
    found = [(BOUNDS[one].waiting, BOUNDS[one].rate) for one in classes]
    assert [tuple(int(cell.replace(",", "")) for cell in row) for row in rows] == found


def keys_of(table: str) -> dict[str, list[str]]:
    """The rows of a table by their first cell, a key each: the other cells."""
    found = {}
    for line in table.splitlines():
        first, *cells = [cell.strip() for cell in line.strip("|").split("|")]
        names = re.findall(r"`(\w+)`", first)
        several = [re.findall(r"\[[^]]*\]|[^, ]+", cell) for cell in cells[:2]]
        for number, name in enumerate(names):
            found[name] = [each[number] if len(each) > number else each[-1] for each in several]
    return found


def test_the_table_of_noise_is_that_of_the_code() -> None:
    """Each key with its default and its largest value."""
    _, _, text = SCENES.partition("| key of `[noise]` |")
    rows = keys_of(text.partition("\n\n")[0].partition("|---|\n")[2])
    assert {name: [float(one) for one in cells] for name, cells in rows.items()} == {
        name: [getattr(Noise(), name), most] for name, _, most in MOST_NOISE
    }
    assert set(rows) | {"seed"} == set(Noise.__struct_fields__)


def test_the_table_of_spreads_is_that_of_the_code() -> None:
    """Each key with its default."""
    _, _, text = SCENES.partition("| key of `[spread]` |")
    rows = keys_of(text.partition("\n\n")[0].partition("|---|\n")[2])
    assert set(rows) == set(Spread.__struct_fields__)
    for name, (default, _) in rows.items():
        assert msgspec.json.decode(default) == pytest.approx(
            msgspec.to_builtins(getattr(Spread(), name)), abs=1e-4
        )


# --- CONTRIBUTING.md: its list of generated files is that of the scripts --------------------------


LISTED = (ROOT / "CONTRIBUTING.md").read_text("utf-8").partition("## Generated files")[2]
WRITES = re.compile(r"^(?:\w+, )?PAGE\b[^=\n]*= (.*?\.md\")", re.MULTILINE | re.DOTALL)
"""How a script names the page that it writes."""


def written_pages() -> dict[str, str]:
    """Return script -> the page that it writes, from the root of the tree."""
    found = {}
    for script in (*(ROOT / "scripts").iterdir(), *(ROOT / "benchmarks").glob("*.py")):
        if script.is_file() and (page := WRITES.search(script.read_text("utf-8"))):
            path = re.sub(r".*(?=docs/)", "", "/".join(re.findall(r'"([^"]+)"', page[1])))
            home = "benchmarks/" if script.parent.name == "benchmarks" and "/" not in path else ""
            found[script.name] = home + path
    return found


def test_every_page_that_a_script_writes_is_listed() -> None:
    """A new generated page cannot be forgotten."""
    assert len(written_pages()) > 12
    assert [one for one in written_pages().items() if f"`{one[1]}`" not in LISTED] == []


def test_the_files_and_scripts_of_the_list_exist() -> None:
    """Each name in code, up to its options."""
    names = {one.split()[-1] for one in re.findall(r"`((?:python )?[\w/.*-]+)[^`]*`", LISTED)}
    names -= {"benchmarks/NAME.py", "startup.py"}
    assert len(names) > 20
    assert [name for name in names if "/" in name and not list(ROOT.glob(name))] == []
