"""`roco ask`: what is printed in each form, what is said where there is no answer, with which exit
code.
"""

import csv
import io
import json
import subprocess
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from console.__main__ import app

POUR = Path(__file__).parents[2] / "histories" / "pour_seed_7"
IN = (
    "SELECT ?thing ?where WHERE { ?thing roco:isIn ?where . ?where a/rdfs:subClassOf*"
    " roco:Container } ORDER BY ?thing"
)
MIXED = (
    "SELECT ?thing ?n ?text ?none WHERE { thing:jar_1 a ?kind BIND(thing:jar_1 AS ?thing) BIND(2.5"
    ' AS ?n) BIND("a, \\"b\\""@en AS ?text) }'
)


def run(*words, text="", recording=POUR):
    """Exit code, standard output, standard error."""
    command = ["ask", *words, "--run", str(recording)]
    done = CliRunner().invoke(app, command, input=text, env={"COLUMNS": "80"})
    return done.exit_code, done.stdout, done.stderr


@pytest.mark.parametrize("recording", [POUR, POUR / "traffic.mcap"])
def test_a_table_for_people(recording):
    """Short names, how many rows, and of which time; of a run folder and of its recording alike."""
    code, out, error = run(IN, "--at", "12", recording=recording)
    lines = [line.split() for line in out.splitlines()]
    assert (code, error) == (0, "")
    things = [["thing:bowl_1", "thing:cabinet_2"], ["thing:jar_1", "thing:cabinet_2"]]
    assert lines[:3] == [["thing", "where"], *things]
    assert out.splitlines()[3] == "2 rows; as km knew it at 12 of 85.7 s"


@pytest.mark.usefixtures("answered_here")
def test_nothing_was_known_before_it_was_told():
    """A recording is asked of any time: km was told first 5 s after the beginning, and of the pour
    last.
    """
    assert "0 rows" in run(IN, "--at", "5")[1]
    assert "content:jar_1" in run(IN)[1]
    assert "content:jar_1" not in run(IN, "--at", "80")[1]


def test_json_as_sparql_has_it():
    """Bound values by column, with type, datatype and language; one object."""
    code, out, _ = run(MIXED, "--format", "json")
    assert code == 0
    assert json.loads(out) == {
        "head": {"vars": ["thing", "n", "text", "none"]},
        "results": {
            "bindings": [
                {
                    "thing": {"type": "uri", "value": "urn:robot-companion:thing/jar_1"},
                    "n": {
                        "type": "literal",
                        "value": "2.5",
                        "datatype": "http://www.w3.org/2001/XMLSchema#decimal",
                    },
                    "text": {"type": "literal", "value": 'a, "b"', "xml:lang": "en"},
                }
            ]
        },
        "cut": False,
    }


@pytest.mark.usefixtures("answered_here")
def test_csv_as_sparql_has_it():
    """A line of columns, then values alone; nothing where a value is missing."""
    _, out, _ = run(MIXED, "--format", "csv")
    row = ["urn:robot-companion:thing/jar_1", "2.5", 'a, "b"', ""]
    assert list(csv.reader(io.StringIO(out))) == [["thing", "n", "text", "none"], row]


@pytest.mark.usefixtures("answered_here")
def test_a_triple_term_is_shown():
    """For people with prefixes, in CSV with whole IRIs, in JSON with its parts."""
    query = "SELECT (<<( thing:jar_1 roco:isIn 'x' )>> AS ?said) {}"
    assert run(query)[1].splitlines()[1].strip() == "<<( thing:jar_1 roco:isIn x )>>"
    space = "urn:robot-companion:"
    assert (
        run(query, "--format", "csv")[1].splitlines()[1]
        == f"<<( {space}thing/jar_1 {space}roco#isIn x )>>"
    )
    said = json.loads(run(query, "--format", "json")[1])["results"]["bindings"][0]["said"]
    assert said["type"] == "triple"
    assert said["value"]["object"] == {"type": "literal", "value": "x"}


@pytest.mark.usefixtures("answered_here")
def test_what_is_shown_may_be_asked():
    """A short name with a slash in it is a name in SPARQL, too."""
    held = "SELECT ?grasp WHERE { thing:jar_1 roco:isGraspedWith ?grasp }"
    shown = run(held, "--at", "30")[1].splitlines()[1].strip()
    assert shown == "grasp:jar\\/47"
    code, text = run(f"ASK {{ thing:jar_1 roco:isGraspedWith {shown} }}", "--at", "30")[:2]
    assert (code, text) == (0, "yes; as km knew it at 30 of 85.7 s\n")


@pytest.mark.usefixtures("answered_here")
@pytest.mark.parametrize(("at", "code", "word"), [("12", 1, "false"), ("30", 0, "true")])
def test_no_is_exit_code_1(at, code, word):
    """As of each verb that is answered with no; in all forms."""
    words = ("ASK { thing:jar_1 roco:isGraspedBy roco:left_hand }", "--at", at, "--format")
    assert run(*words, "csv")[:2] == (code, f"{word}\n")
    assert run(*words, "json")[:2] == (code, f'{{"head":{{}},"boolean":{word}}}\n')


@pytest.mark.usefixtures("answered_here")
def test_rows_left_out_are_told_in_each_form():
    """In the table's last line, in the object, beside the csv."""
    every = ("SELECT ?a WHERE { ?a ?b ?c }", "--rows", "3")
    assert "3 rows, and there are more (--rows)" in run(*every)[1]
    assert json.loads(run(*every, "--format", "json")[1])["cut"] is True
    _, out, error = run(*every, "--format", "csv")
    assert len(out.splitlines()) == 4
    assert "only the first 3 rows" in error


@pytest.mark.usefixtures("answered_here")
def test_a_question_from_standard_input():
    """Quotes of the shell need not be escaped."""
    assert "thing:jar_1" in run("-", "--at", "12", text=IN)[1]


@pytest.mark.usefixtures("answered_here")
def test_updates_are_wrong_use():
    """Exit code 2, and what to write instead."""
    code, out, error = run("DELETE WHERE { ?a ?b ?c }")
    assert (code, out) == (2, "")
    assert "write SELECT or ASK" in error
    code, _, error = run("INSERT DATA { thing:a a roco:Jar }", "--format", "json")
    assert (code, "only reads" in json.loads(error)["error"]) == (2, True)


def test_a_heavy_query_ends_in_time():
    """Exit code 1, and the sentence says what to do."""
    heavy = "SELECT (COUNT(*) AS ?n) WHERE { ?a ?b ?c . ?d ?e ?f . ?g ?h ?i . ?j ?k ?l }"
    code, out, error = run(heavy, "--seconds", "0.2")
    assert (code, out) == (1, "")
    assert "ended after 0.2 s" in error


def test_a_place_without_a_recording_is_named(tmp_path):
    """Exit code 2: there is nothing to ask."""
    code, _, error = run(IN, recording=tmp_path)
    assert code == 2
    assert "give a run folder" in error


@pytest.mark.parametrize(("module", "extra"), [("pyoxigraph", "knowledge"), ("mcap", "monitor")])
def test_what_is_not_installed_is_named(module, extra, tmp_path, monkeypatch):
    """With the extra that has it."""
    missing = f"raise ModuleNotFoundError(\"No module named '{module}'\", name='{module}')\n"
    (tmp_path / f"{module}.py").write_text(missing, encoding="utf-8")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    command = [sys.executable, "-m", "console", "ask", IN, "--run", str(POUR)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=50, check=False)
    assert done.returncode == 1
    assert f"robot-companion[{extra}]" in done.stderr
    assert module in done.stderr
