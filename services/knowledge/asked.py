"""`python -m services.knowledge.asked`: a companion.asking.Question on standard input, its Answer on standard output.

The operating system keeps the bounds: it ends the process when the query has taken its time, wherever it is, gives it
no more than so much memory, and no file or socket besides those that are open.
"""

import re
import resource
import signal
import sys
from itertools import islice

import msgspec
import pyoxigraph as ox

from companion.asking import PREFIXES, Answer, Question, Refused, Rows, Term, Verdict
from services.knowledge.beliefs import believed
from services.knowledge.dataset import dataset

MEMORY_BYTES = 2 * 1024**3
"""Beside a robot's own processes; estimate. A recording of a pour and its answer take a tenth of it."""

_QUIET = re.compile(
    r"""'{3}(?:[^'\\]|\\.|'(?!''))*'{3}|"{3}(?:[^"\\]|\\.|"(?!""))*"{3}|'(?:[^'\\\n\r]|\\.)*'|"(?:[^"\\\n\r]|\\.)*\""""
    r"""|<[^<>"{}|^`\\\s]*>|\#[^\n\r]*|\\.""",
    re.DOTALL,
)
"""Strings, IRIs, comments and escaped characters of SPARQL: words in them ask for nothing."""
_ESCAPE = re.compile(r"\\u([0-9A-Fa-f]{4})|\\U([0-9A-Fa-f]{8})")
_WORD = re.compile(r"[?$@:\w.\-]+:?")
_UPDATES = {"INSERT", "DELETE", "LOAD", "CLEAR", "DROP", "CREATE", "ADD", "MOVE", "COPY", "WITH"}
_GRAPHS = {"CONSTRUCT", "DESCRIBE"}


def unescaped(text: str) -> str:
    r"""The query without \uXXXX, which SPARQL replaces before it looks for words."""
    while (plain := _ESCAPE.sub(lambda found: chr(int(found[1] or found[2], 16)), text)) != text:
        text = plain
    return text


def refusal(text: str) -> str:
    """Return why a query (without escapes) is not evaluated, "" if it may be."""
    plain = _QUIET.sub(" ", text).upper()
    words = _WORD.findall(plain)
    first = next((word for word in words if word in {"SELECT", "ASK", *_UPDATES, *_GRAPHS}), "")
    if first in _UPDATES:
        return f"{first} would change what km knows, and `roco ask` only reads; write SELECT or ASK"
    if first in _GRAPHS:
        return f"{first} gives a graph, and `roco ask` gives rows; write SELECT or ASK"
    if "SERVICE" in plain:  # part of a word, too: a parser may find the end of a word elsewhere
        return "SERVICE asks another store over the network, and `roco ask` asks only this one; leave the word away"
    return "" if first else "there is neither SELECT nor ASK in the question; write one of them"


def answer(question: Question) -> Answer:
    """The answer, from what km had heard; the time of the query is bounded by the process's end."""
    text = unescaped(question.text)
    if why := refusal(text):
        return Refused(why)
    triples = dataset(believed(question.heard), question.begin)
    bound(question.seconds)
    try:
        return _told(triples.query(text, prefixes=PREFIXES), question.rows)
    except SyntaxError as error:
        return Refused(f"this is not SPARQL: {error}")


def bound(seconds: float) -> None:
    """From here on this process lives that long at most, and opens nothing more: no SERVICE reaches the network."""
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))
    resource.setrlimit(resource.RLIMIT_NOFILE, (0, 0))
    signal.setitimer(signal.ITIMER_REAL, seconds)


def _told(found: ox.QuerySolutions | ox.QueryBoolean | ox.QueryTriples, most: int) -> Answer:
    if isinstance(found, ox.QueryBoolean):
        return Verdict(bool(found))
    assert isinstance(found, ox.QuerySolutions)  # the others were refused
    columns = tuple(variable.value for variable in found.variables)
    rows = tuple(tuple(map(_term, solution)) for solution in islice(found, most))
    return Rows(columns, rows, next(found, None) is not None)


def _term(value: object) -> Term | None:
    match value:
        case ox.NamedNode():
            return Term("uri", value.value)
        case ox.BlankNode():
            return Term("bnode", value.value)
        case ox.Literal(language=str(language)):
            return Term("literal", value.value, lang=language)
        case ox.Literal():
            plain = value.datatype.value == f"{PREFIXES['xsd']}string"
            return Term("literal", value.value, "" if plain else value.datatype.value)
        case _:
            return None


def main() -> None:
    """Answer once."""
    question = msgspec.msgpack.decode(sys.stdin.buffer.read(), type=Question)
    sys.stdout.buffer.write(msgspec.msgpack.encode(answer(question)))


if __name__ == "__main__":
    main()
