"""`roco design verify|follow|export`: what is printed, in both forms, and the exit codes."""

import json
import re
import shutil
from functools import partial
from pathlib import Path

import msgspec
import pytest
from calling import printed, roco
from typer.testing import Result

from agent_runtime.io import steplog
from companion.design import DESIGN, FILE
from console.design.verify import TITLES, so_far
from topdown.prove.net import promela
from topdown.prove.pairs import net_of

TESTS = Path(__file__).resolve().parents[1]
LAMP = TESTS / "topdown/lamp.toml"
HISTORY = TESTS / "histories/deeds_seed_7"
HAND = """row = [
  { in = ["idle"], on = "person wish", say = ["switch request"] },
  { in = ["idle"], on = "switch inform" },
]
arc = [{ source = "idle", target = "idle" }]
"""
SHINES = """row = [{ in = ["idle"], on = "switch request", say = ["switch inform"] }]
arc = [{ source = "idle", target = "idle" }]
"""
ARC = 'arc = [{ source = "idle", target = "idle" }]\n'


design = partial(roco, "design", columns=80)


@pytest.fixture
def lamp(tmp_path: Path) -> Path:
    """The lamp with rows, so that it can be composed."""
    hand, _, shines = LAMP.read_text().partition(ARC)
    file = tmp_path / "lamp.toml"
    file.write_text(hand + HAND + shines.replace(ARC, SHINES))
    return file


@pytest.fixture
def dark(lamp: Path) -> Path:
    """Its lamp takes the request and says nothing."""
    file = lamp.with_name("dark.toml")
    file.write_text(
        lamp.read_text().replace(
            'on = "switch request", say = ["switch inform"]', 'on = "switch request"'
        )
    )
    return file


def said(result: Result) -> str:
    """All that was printed."""
    return result.output + result.stderr


def test_what_is_left_is_told_as_what_waits_at_the_rate_so_far() -> None:
    """Not what nobody knows: how many states there are."""
    assert so_far(5000, 1000, 2.0) == (
        "5,000 states, 1,000 wait, at least 0 s more; 2,000/s, 2 s of processor"
    )
    assert so_far(5000, 5000, 0.0) == "5,000 states, 5,000 wait; 0/s, 0 s of processor"


# --- verify ---------------------------------------------------------------------------------------


def test_a_design_that_holds_exits_with_0(lamp: Path) -> None:
    """A line for each verdict under the title of its layer, what all say together, and what none
    says.
    """
    done = design("verify", lamp, code=0)
    lines = done.output.splitlines()
    titles = [line for line in lines if line.startswith("Layer")]
    assert titles == list(TITLES.values())
    holds = [line.split()[0] for line in lines if line.endswith("holds")]
    assert holds == ["durable", "C1", "all", "all"]
    assert "any faults" in lines[1]
    assert "1 fault " in next(line for line in lines if "C1 switch" in line)
    assert "0 faults" in next(line for line in lines if "starting" in line)
    assert re.search(r" states +[\d.]+ s +[\d.]+ s CPU  holds$", lines[1])
    assert "4 verdicts" in done.output
    assert "0 fail, 0 open" in done.output
    assert "Not proven by any layer:\n- several conversations" in done.output


def test_the_companion_is_the_default() -> None:
    """Its layer 2 has eight uses of protocols."""
    done = design("verify", "--layer", 2, "--faults", 0, code=0)
    assert "C2 execute_command" in done.output
    assert "8 verdicts" in done.output


def test_a_finding_exits_with_1_and_has_its_story(dark: Path) -> None:
    """The story tells which agent did what until the fault."""
    done = design("verify", dark, "--layer", 3, code=1)
    assert done.output.count("FAILS") == 2
    assert "deadlock: lamp in idle: switch is asked, where only lamp can go on" in done.output
    assert "  1  o--switch request-->" in done.output
    assert "* person wish" in done.output
    assert "[idle; switch: asked]" in done.output
    assert "2 fail, 0 open" in done.output


def test_agents_without_rows_are_open_and_exit_with_1() -> None:
    """Nothing was found, and nothing is proven."""
    done = design("verify", LAMP, "--layer", 3, "--faults", "any", code=1)
    assert "agents without rows cannot be composed: hand, lamp" in done.output
    assert "0 fail, 2 open" in done.output
    assert "-1 fault" not in done.output
    design("verify", LAMP, "--layer", 2, code=0)


def test_json_has_every_verdict(lamp: Path, dark: Path) -> None:
    """With its figures; findings with their traces; nothing else is printed."""
    found = printed("design", "verify", lamp)
    assert [(one["layer"], one["what"], one["faults"], one["holds"]) for one in found] == [
        (1, "durable stream", None, True),
        (2, "C1 switch", 1, True),
        (3, "all agents, starting", 0, True),
        (3, "all agents", 1, True),
    ]
    assert all(one["states"] > 1 and one["edges"] > 1 and one["findings"] == [] for one in found)
    done = design("verify", dark, "--layer", 3, "--format", "json", code=1)
    (finding,) = json.loads(done.stdout)[1]["findings"]
    assert (finding["kind"], finding["trace"][0]["who"]) == ("deadlock", "hand")
    assert finding["trace"][0]["what"] == "person wish; switch request -> lamp"


def test_faults_and_layers_are_those_asked_for(lamp: Path) -> None:
    """Any number of faults, too; layers in their order, however they are named."""
    for layers, faults, told in (
        ((1,), "0", None),
        ((2,), "0", 0),
        ((3,), "any", None),
        ((3, 2), "2", 2),
    ):
        words = [word for layer in layers for word in ("--layer", layer)]
        found = printed("design", "verify", lamp, *words, "--faults", faults)
        assert sorted({one["layer"] for one in found}) == sorted(layers)
        assert [one["layer"] for one in found] == sorted(one["layer"] for one in found)
        assert found[-1]["faults"] == told


def test_a_step_has_the_channels_it_changed() -> None:
    """Step 4 of the companion; layer 2 alone."""
    done = design("verify", "--step", 1, LAMP, code=0)
    assert "1 verdicts" in done.output
    some = design("verify", FILE, "--step", 3, "--faults", 0, code=0)
    assert "Layer 2" in some.output
    assert "Layer 3" not in some.output
    assert "8 verdicts" not in some.output


def test_who_may_die_for_good(lamp: Path) -> None:
    """The hand's wish has no end then: nothing tells it that the lamp is gone."""
    done = design("verify", lamp, "--layer", 3, "--gone", "lamp", code=1)
    assert "lamp dies for good" in done.output
    assert "* dies for good" in done.output
    assert "1 fail, 0 open" in done.output


def test_what_is_lost_with_each_agent(lamp: Path) -> None:
    """`all` asks of each in turn; of the hand, whose wishes are the only ones, nothing is left to
    be explored.
    """
    done = design("verify", lamp, "--layer", 3, "--gone", "all", "--faults", 0, code=1)
    text = " ".join(done.output.split())
    assert "hand dies for good" not in text
    assert "- hand: R1 is lost; persons talk to it alone, so nobody is left whose wish" in text
    assert "- lamp: R1 is lost; wishes of persons may never end" in text
    assert "deadlock: hand in idle: switch is asked" in text
    told = printed("design", "verify", lamp, "--layer", 3, "--gone", "all", "--faults", 0, code=1)
    assert [(one["what"], one["lost"]) for one in told][-1] == (
        "lamp dies for good",
        {"whole": ["R1"], "part": []},
    )
    assert told[-1]["findings"][0]["causes"][0].startswith("hand in idle: switch is asked")
    depot = TESTS.parent / "examples/depot/depot/design.toml"
    rest = "mule: R3, R4, R5 are lost in part; the rest holds: every wish of a person still ends"
    words = ("verify", depot, "--layer", 3, "--gone", "mule", "--faults", 0, "--skip-start")
    assert rest in " ".join(design(*words, code=0).output.split())


def test_the_start_may_be_left_out(lamp: Path) -> None:
    """It is the longest verdict where agents open subscriptions."""
    found = printed("design", "verify", lamp, "--layer", 3, "--skip-start")
    assert [one["what"] for one in found] == ["all agents"]


def test_what_time_leaves_open_is_said(lamp: Path) -> None:
    """With exit code 1."""
    done = design("verify", lamp, "--layer", 2, "--seconds", 1e-9, code=1)
    assert "open" in done.output.splitlines()[1]
    assert "stopped at the limit of 1e-09 CPU seconds" in done.output
    design("verify", lamp, "--layer", 2, "--seconds", 0, code=1)
    design("verify", lamp, "--layer", 2, "--seconds", 60, code=0)


def test_long_tells_what_is_left_out_and_not_needed(lamp: Path) -> None:
    """The short form only counts the rows that no path needed."""
    file = lamp.with_name("more.toml")
    never = '  { in = ["idle"], on = "switch refuse" },\n  { in = ["idle"], on = "switch inform" },'
    file.write_text(lamp.read_text().replace('  { in = ["idle"], on = "switch inform" },', never))
    short, long = (
        design("verify", file, "--layer", 3),
        design("verify", file, "--layer", 3, "--long"),
    )
    assert "1 rows or states were not needed by any path; --long lists them" in short.output
    assert "row never used: hand 2 (in idle on switch refuse)" in long.output
    assert "row never used" not in short.output
    assert "contents of messages are dropped" in long.output
    assert "contents of messages are dropped" not in short.output
    assert (
        "Not needed by any path:\n  nothing"
        in design("verify", lamp, "--layer", 3, "--long").output
    )


def test_lines_fit_the_terminal(lamp: Path) -> None:
    """But for verdicts, which are of one width, and stories."""
    for columns in (60, 120):
        lines = design("verify", lamp, "--long", columns=columns).output.splitlines()
        assert [line for line in lines if len(line) > max(columns, 80)] == []


def test_an_option_that_makes_no_sense_exits_with_2(lamp: Path) -> None:
    """And says what would."""
    for words, told in (
        (("--faults", "many"), "--faults 'many' is no number; say 0, 1, 2 or any"),
        (("--faults", "-1"), "'-1' is no number"),
        (("--layer", "4"), "layers are 1, 2, 3"),
        (("--step", "1", "--layer", "3"), "a step changes channels of layer 2 only"),
        (("--step", "9"), "steps 1 to 1"),
        (("--gone", "lump"), "hand, lamp"),
        (
            ("--gone", "hand"),
            "hand alone has `person` rows, so nobody is left whose wish could end; name another",
        ),
    ):
        done = design("verify", lamp, *words, code=2)
        assert told in " ".join(done.stderr.split()), words
    assert (
        "steps 1 to 1"
        in json.loads(design("verify", lamp, "--step", "9", "--format", "json").stderr)["error"]
    )


def test_a_design_with_a_group_is_proven() -> None:
    """In every layer; an end that is neither an agent nor a group is an error in words."""
    done = design("verify", TESTS / "topdown/grouped.toml", code=0)
    assert "C2 drive" in done.output
    assert "5 verdicts" in done.output


def test_an_end_that_is_nobody_exits_with_2(tmp_path: Path) -> None:
    """With what would be right."""
    file = tmp_path / "nobody.toml"
    text = (TESTS / "topdown/grouped.toml").read_text()
    start = text.index("[[group]]")
    file.write_text(text[:start] + text[text.index("\n\n", start) :])
    done = design("verify", file, "--layer", 3, code=2)
    wrong = "protocol drive: 'base' is neither an agent nor a group; agents are asker, doer"
    assert wrong in " ".join(done.stderr.split())


def test_a_queue_that_progress_fills_is_told_as_not_proven(lamp: Path) -> None:
    """With the row that may be taken over and over; for programs too."""
    file = lamp.with_name("chatty.toml")
    when = 'when = ["switch agreed"]'
    rows = f"""\"switch request", say = ["switch agree"] }},
  {{ in = ["idle"], on = "own flicker", {when}, may = ["switch inform[progress]"] }},
  {{ in = ["idle"], on = "own lit", {when}, say = ["switch inform"] }}"""
    hears = """  { in = ["idle"], on = "switch agree" },
  { in = ["idle"], on = "switch inform[progress]" },
"""
    text = lamp.read_text().replace('"switch request", say = ["switch inform"] }', rows)
    ends = '  { in = ["idle"], on = "switch inform" },'
    file.write_text(text.replace(ends, hears + ends))
    done = design("verify", file, "--layer", 3, columns=200, code=0)
    assert (
        "Not proven by any layer:\n- how many `switch inform[progress]` of lamp wait for hand"
        in done.output
    )
    found = printed("design", "verify", file, "--layer", 3)
    assert [len(one["beyond"]) for one in found] == [0, 1]


def test_a_file_that_cannot_be_read_exits_with_2(lamp: Path) -> None:
    """It is not there, or a row of it says nothing."""
    design("verify", lamp.with_name("none.toml"), code=2)
    lamp.write_text(lamp.read_text().replace('on = "person wish"', 'on = "prson wish"'))
    done = design("verify", lamp, code=2)
    assert "agent hand, row 1: no protocol 'prson'" in done.stderr


# --- follow ---------------------------------------------------------------------------------------


def test_a_recorded_run_is_followed() -> None:
    """A pour of six processes."""
    done = design("follow", HISTORY, code=0)
    assert done.output.startswith("659 steps, each a move of the model")
    told = printed("design", "follow", HISTORY)
    assert told == {"steps": 659, "deviation": None}


def spoilt(folder: Path) -> int:
    """The same run, in which co said one word other than it did; the number of that step of
    co's.
    """
    shutil.copytree(HISTORY, folder)
    file = folder / "steps/co.steps"
    steps = list(steplog.read(file))
    place = next(n for n, step in enumerate(steps) if step.deed is not None and step.deed.said)
    deed = steps[place].deed
    assert deed is not None
    (use, act, kind), *rest = deed.said
    other = msgspec.structs.replace(deed, said=((use, type(act)("refuse"), kind), *rest))
    steps[place] = msgspec.structs.replace(steps[place], deed=other)
    data = [msgspec.msgpack.encode(step) for step in steps]
    file.write_bytes(b"".join(steplog.HEAD.pack(len(one)) + one for one in data))
    return place


def test_a_spoilt_run_exits_with_1_and_names_the_step(tmp_path: Path) -> None:
    """With what the agent did, and where the model would be."""
    spoilt(tmp_path / "run")
    done = design("follow", tmp_path / "run", code=1)
    lines = done.output.splitlines()
    assert "is no move of the model: co in trigger on execute_command request" in lines[0]
    assert "said execute_command refuse" in lines[0]
    assert {line.split()[0] for line in lines[2:8]} == set(DESIGN.agents)
    told = printed("design", "follow", tmp_path / "run", code=1)
    assert told["deviation"]["agent"] == "co"
    assert told["deviation"]["number"] == told["steps"] < 659
    assert lines[0].startswith(f"step {told['steps']} ")


def test_another_design_is_not_followed_by_this_run(lamp: Path) -> None:
    """Its agents are others."""
    done = design("follow", HISTORY, "--design", lamp, code=2)
    assert "; the design has hand, lamp" in done.stderr


def test_a_folder_without_steps_exits_with_2(tmp_path: Path) -> None:
    """In words."""
    done = design("follow", tmp_path, code=2)
    assert "has no steps; name the folder of a run" in " ".join(done.stderr.split())
    design("follow", tmp_path / "none", code=2)


# --- `roco design export`: files for spin, of any design file. ------------------------------------


export = partial(roco, "design", "export")


def test_one_use_goes_to_one_file(tmp_path: Path) -> None:
    """The text is that of the net which is explored."""
    file = tmp_path / "plan.pml"
    said = export("--promela", str(file), "--use", "execute_plan", "--faults", "1", code=0)
    assert file.read_text() == promela(net_of(DESIGN, "execute_plan", 1))
    assert f"spin -a -o1 -o2 {file}" in said.stdout.replace("\n", "")


def test_a_pair_goes_to_a_folder(tmp_path: Path) -> None:
    """Both uses that are meant, each in a file of its own."""
    said = export(
        "--promela",
        str(tmp_path / "models"),
        "--pair",
        "co-ta",
        "--use",
        "generate_plan",
        "--format",
        "json",
        code=0,
    )
    written = json.loads(said.stdout)
    assert [one["use"] for one in written] == ["generate_plan", "execute_plan"]
    for one in written:
        assert Path(one["file"]).read_text() == promela(net_of(DESIGN, one["use"], 0))


def test_another_design_is_exported_whole(tmp_path: Path) -> None:
    """Nothing of the companion is needed."""
    export(str(LAMP), "--promela", str(tmp_path), "--ideal", code=0)
    assert [path.name for path in tmp_path.iterdir()] == ["switch.pml"]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ([], "nothing to write; name a file or a folder with --promela"),
        (["--promela", "x.pml", "--use", "dance"], "execute_plan"),
        (["--promela", "x.pml", "--pair", "co"], "write two agents with - between"),
        (["--promela", "x.pml", "--pair", "hi-ex"], "hi-co"),
    ],
)
def test_what_is_wrong_is_said_with_what_would_be_right(
    words: list[str], said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And nothing is written."""
    monkeypatch.chdir(tmp_path)
    result = export(*words, code=2)
    assert said in result.stderr
    assert not list(tmp_path.iterdir())
