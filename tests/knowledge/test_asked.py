"""Questions are read-only and bounded: what would change or leave the store is refused, what takes
long is ended.
"""

import signal
import socket
import subprocess
import sys

import msgspec
import pytest

from companion.asking import (
    ANSWERER,
    PREFIXES,
    Answer,
    Question,
    Refused,
    Rows,
    Term,
    Triple,
    Verdict,
)

CROSS = "SELECT (COUNT(*) AS ?n) WHERE { ?a ?b ?c . ?d ?e ?f . ?g ?h ?i . ?j ?k ?l }"
UPDATES = (
    "INSERT DATA { thing:a roco:isIn thing:b }",
    "delete where { ?a ?b ?c }",
    "WITH <urn:g> DELETE { ?a ?b ?c } WHERE { ?a ?b ?c }",
    "PREFIX select: <urn:select> CLEAR ALL",
    "# SELECT\nLOAD <http://example.org/>",
    "DROP ALL ; ADD <urn:a> TO <urn:b>",
    "CREATE GRAPH <urn:g>",
    "COPY <urn:a> TO DEFAULT",
    "MOVE <urn:a> TO <urn:b>",
)
SERVICES = (
    "SELECT * { SERVICE <http://127.0.0.1:1/> { ?a ?b ?c } }",
    "SELECT * { ?a ?b ?c.service silent?x{} }",
    "ASK { ?a ?b 5SERVICE<http://127.0.0.1:1/>{} }",
    "ASK { ?a ?b '''\\'''' . SERVICE <http://127.0.0.1:1/> {} ?d ?e ''' ''' }",
    "ASK { ?a ?b roco:x\\' . SERVICE <http://127.0.0.1:1/> {} ?d ?e roco:x\\' }",
    "SELECT * { SERVICE SILENT <http://127.0.0.1:1/> { ?a ?b ?c } }",
    "ASK { FILTER EXISTS { VALUES ?service { 1 } SERVICE ?service { } } }",
    "ASK { FILTER(?x = <<( ?service ?b 1 )>>) SERVICE roco:service { } }",
    "ASK { ?a ?b ?c FILTER(?a<?b) SERVICE ?s { ?x ?y ?z FILTER(?a>?b) } }",
)


NO_SPARQL = (
    "\\u0043REATE GRAPH <urn:g>",
    "ASK { \\u0053ERVICE ?x {} }",
    "hello",
    "SELECT *",
    "service",
)
"""Escaped characters make no keywords."""
HARMLESS = (
    "SELECT * { ?insert ?b 'DELETE SERVICE' }",
    'ask { ?a ?b """a "service" of \\"x""" , \'x\' }',
    "PREFIX load: <urn:SERVICE> SELECT ?drop { ?drop a load:x } # SERVICE\n",
    "SELECT * { ?a rdfs:label 'insert'@en }",
    "SELECT?x { }",
    "SELECT ?service { ?service roco:serviceable ?Service } GROUP BY ?service",
    "PREFIX service: <urn:service> ASK { service:x ?b _:service }",
)
REFUSED = {
    **dict.fromkeys(UPDATES, "only reads"),
    **dict.fromkeys(SERVICES, "network"),
    **dict.fromkeys(("CONSTRUCT WHERE { ?a ?b ?c }", "DESCRIBE thing:jar_1"), "SELECT or ASK"),
    **dict.fromkeys(NO_SPARQL, "this is not SPARQL"),
    "SELECT * {\n ?a ?b }": "2:9",
}
"""Question -> the reason why it is refused; of what is no SPARQL, with line and column of the first
fault.
"""
BATCH = """
import sys, msgspec
from companion.asking import Question
from services.knowledge.asked import answer
asked = msgspec.msgpack.decode(sys.stdin.buffer.read(), type=list[Question])
sys.stdout.buffer.write(msgspec.msgpack.encode([answer(one) for one in asked]))
"""


def question(text, seconds=5.0, rows=1000):
    """About the ontology alone: km was told nothing."""
    return Question(text, (), 0.0, seconds, rows)


def run(*words, data=b""):
    """A process as for a question."""
    bounds = {"timeout": 50, "check": False}
    return subprocess.run([sys.executable, *words], input=data, capture_output=True, **bounds)


def told(*questions):
    """Their answers, all of one process: it lasts half a second until it can answer."""
    done = run("-c", BATCH, data=msgspec.msgpack.encode(questions))
    assert done.returncode == 0, done.stderr.decode()
    return msgspec.msgpack.decode(done.stdout, type=list[Answer])


def rows_of(*questions):
    """The rows of each."""
    answers = told(*questions)
    assert all(isinstance(one, Rows) for one in answers), answers
    return [one for one in answers if isinstance(one, Rows)]


def test_what_would_change_or_leave_the_store_is_refused():
    """However it is written, whatever words stand before it, and whether or not it is reached or
    may fail.
    """
    answers = dict(zip(REFUSED, told(*map(question, REFUSED)), strict=True))
    whys = {one: getattr(answers[one], "why", "") for one in REFUSED}
    assert {one for one, why in REFUSED.items() if why not in whys[one]} == set()


def test_words_in_names_strings_and_comments_are_no_orders():
    """They are evaluated."""
    answers = zip(HARMLESS, told(*map(question, HARMLESS)), strict=True)
    assert [text for text, answer in answers if isinstance(answer, Refused)] == []


def test_values_are_those_of_the_query():
    """A character is unescaped once: a backslash that is escaped itself, either way, begins no
    escape.

    A triple term is a value with its parts, one of which may be a triple term again, and the
    direction of a text.
    """
    texts = {r"'\u0041'": "A", r"'\\u0041'": r"\u0041", r"'\u005Cu0041'": r"\u0041"}
    values = {text: Term("literal", value) for text, value in texts.items()}
    a, b = (Term("uri", f"{PREFIXES['roco']}{name}") for name in "ab")
    within = Term("triple", Triple(a, b, Term("literal", "x", lang="en", direction="ltr")))
    values["<<( roco:a roco:b <<( roco:a roco:b 'x'@en--ltr )>> )>>"] = Term(
        "triple", Triple(a, b, within)
    )
    answers = rows_of(*(question(f"SELECT ({text} AS ?x) {{}}") for text in values))
    assert [one.rows for one in answers] == [((value,),) for value in values.values()]


def test_rows_are_bounded_while_they_come():
    """The first rows of a cross join that never would end. Whether there are more is said, not of
    the last one.
    """
    every = "SELECT ?a ?d ?g ?j WHERE { ?a ?b ?c . ?d ?e ?f . ?g ?h ?i . ?j ?k ?l }"
    few = [question("SELECT ?x { VALUES ?x { 1 2 3 } }", rows=most) for most in (2, 3, 4)]
    answers = rows_of(question(every, seconds=30.0, rows=7), *few)
    found = [(len(one.rows), one.cut) for one in answers]
    assert found == [(7, True), (2, True), (3, False), (3, False)]


def test_a_question_is_answered_by_its_own_process():
    """As `roco ask` asks it."""
    done = run("-m", ANSWERER, data=msgspec.msgpack.encode(question("ASK { }")))
    assert msgspec.msgpack.decode(done.stdout, type=Answer) == Verdict(True)


def test_a_query_that_takes_too_long_is_ended_by_the_system():
    """A cross join of some 10^11 rows, bound to 0.3 s: the process is gone, by its alarm."""
    done = run("-m", ANSWERER, data=msgspec.msgpack.encode(question(CROSS, seconds=0.3)))
    assert done.returncode == -signal.SIGALRM


def test_no_socket_is_opened_even_by_a_query_that_was_let_through():
    """The bounds hold without the check of words: a SERVICE that listens is never called."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        server.settimeout(1.0)
        place = f"http://127.0.0.1:{server.getsockname()[1]}/"
        code = (
            "import pyoxigraph as ox\nfrom services.knowledge.asked import"
            f" bound\nbound(20.0)\nlist(ox.Store().query('SELECT * {{ SERVICE <{place}> {{ ?a ?b ?c"
            " } }'))"
        )
        assert run("-c", code).returncode != 0
        with pytest.raises(TimeoutError):
            server.accept()
