"""Questions are read-only and bounded: what would change or leave the store is refused, what takes long is ended."""

import signal
import socket
import subprocess
import sys

import msgspec
import pytest

from companion.asking import ANSWERER, PREFIXES, Answer, Question, Refused, Rows, Term, Triple

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


def question(text: str, seconds: float = 5.0, rows: int = 1000) -> Question:
    """About the ontology alone: km was told nothing."""
    return Question(text, (), 0.0, seconds, rows)


def ended(asked_: Question, limit: float = 50.0) -> subprocess.CompletedProcess[bytes]:
    """Return the result of the question's own process."""
    data = msgspec.msgpack.encode(asked_)
    return subprocess.run([sys.executable, "-m", ANSWERER], input=data, capture_output=True, timeout=limit, check=False)


def told(asked_: Question) -> Answer:
    """Its answer."""
    done = ended(asked_)
    assert done.returncode == 0, done.stderr.decode()
    answer: Answer = msgspec.msgpack.decode(done.stdout, type=Answer)
    return answer


def refused(text: str) -> str:
    """Why it is refused."""
    answer = told(question(text))
    assert isinstance(answer, Refused)
    return answer.why


@pytest.mark.parametrize("text", UPDATES)
def test_updates_are_refused(text: str) -> None:
    """Whatever words are before what changes something."""
    assert "only reads" in refused(text)


@pytest.mark.parametrize("text", SERVICES)
def test_other_stores_are_not_asked(text: str) -> None:
    """However the word is written, and whether or not it is reached or may fail."""
    assert "network" in refused(text)


@pytest.mark.parametrize("text", ["CONSTRUCT WHERE { ?a ?b ?c }", "DESCRIBE thing:jar_1"])
def test_graphs_are_refused(text: str) -> None:
    """Rows are what can be bounded and printed."""
    assert "SELECT or ASK" in refused(text)


@pytest.mark.parametrize(
    "text", ["\\u0043REATE GRAPH <urn:g>", "ASK { \\u0053ERVICE ?x {} }", "hello", "SELECT *", "service"]
)
def test_what_is_no_sparql_is_refused(text: str) -> None:
    """Escaped characters make no words."""
    assert "this is not SPARQL" in refused(text)


@pytest.mark.parametrize(
    "text",
    [
        "SELECT * { ?insert ?b 'DELETE SERVICE' }",
        'ask { ?a ?b """a "service" of \\"x""" , \'x\' }',
        "PREFIX load: <urn:SERVICE> SELECT ?drop { ?drop a load:x } # SERVICE\n",
        "SELECT * { ?a rdfs:label 'insert'@en }",
        "SELECT?x { }",
        "SELECT ?service { ?service roco:serviceable ?Service } GROUP BY ?service",
        "PREFIX service: <urn:service> ASK { service:x ?b _:service }",
    ],
)
def test_words_in_names_strings_and_comments_are_no_orders(text: str) -> None:
    """They are evaluated."""
    assert not isinstance(told(question(text)), Refused)


@pytest.mark.parametrize(
    ("text", "value"), [(r"'\u0041'", "A"), (r"'\\u0041'", r"\u0041"), (r"'\u005Cu0041'", r"\u0041")]
)
def test_a_character_is_unescaped_once(text: str, value: str) -> None:
    """A backslash that is escaped itself, either way, begins no escape."""
    answer = told(question(f"SELECT ({text} AS ?x) {{}}"))
    assert isinstance(answer, Rows)
    assert answer.rows == ((Term("literal", value),),)


def test_a_triple_term_is_a_value() -> None:
    """With its parts, one of which may be a triple term again, and the direction of a text."""
    inner = "<<( roco:a roco:b 'x'@en--ltr )>>"
    answer = told(question(f"SELECT (<<( roco:a roco:b {inner} )>> AS ?x) {{}}"))
    a, b = (Term("uri", f"{PREFIXES['roco']}{name}") for name in "ab")
    within = Term("triple", Triple(a, b, Term("literal", "x", lang="en", direction="ltr")))
    assert isinstance(answer, Rows)
    assert answer.rows == ((Term("triple", Triple(a, b, within)),),)


def test_what_is_no_sparql_is_said_with_its_place() -> None:
    """Line and column of the first fault."""
    answer = told(question("SELECT * {\n ?a ?b }"))
    assert isinstance(answer, Refused)
    assert "2:9" in answer.why


def test_a_query_that_takes_too_long_is_ended_by_the_system() -> None:
    """A cross join of some 10^11 rows, bound to 0.3 s: the process is gone, by its alarm."""
    assert ended(question(CROSS, seconds=0.3)).returncode == -signal.SIGALRM


def test_rows_are_bounded_while_they_come() -> None:
    """The first rows of a cross join that never would end; and whether there are more."""
    every = "SELECT ?a ?d ?g ?j WHERE { ?a ?b ?c . ?d ?e ?f . ?g ?h ?i . ?j ?k ?l }"
    answer = told(question(every, seconds=30.0, rows=7))
    assert isinstance(answer, Rows)
    assert (len(answer.rows), answer.cut) == (7, True)


@pytest.mark.parametrize(("rows", "cut"), [(2, True), (3, False), (4, False)])
def test_cut_is_said_where_there_are_more(rows: int, cut: bool) -> None:
    """Not where the last row is just the last one allowed."""
    answer = told(question("SELECT ?x { VALUES ?x { 1 2 3 } }", rows=rows))
    assert isinstance(answer, Rows)
    assert (len(answer.rows), answer.cut) == (min(rows, 3), cut)


def test_no_socket_is_opened_even_by_a_query_that_was_let_through() -> None:
    """The bounds hold without the check of words: a SERVICE that listens is never called."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        server.settimeout(1.0)
        place = f"http://127.0.0.1:{server.getsockname()[1]}/"
        code = (
            "import pyoxigraph as ox\nfrom services.knowledge.asked import bound\n"
            f"bound(20.0)\nlist(ox.Store().query('SELECT * {{ SERVICE <{place}> {{ ?a ?b ?c }} }}'))"
        )
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, timeout=40, check=False)
        assert done.returncode != 0
        with pytest.raises(TimeoutError):
            server.accept()
