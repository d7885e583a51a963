"""`python -m services.knowledge.asked`: a companion.asking.Question on standard input, its Answer
on standard output.

The operating system keeps the bounds: it ends the process when the query has taken its time,
wherever it is, gives it no more than so much memory, and no file or socket besides those that are
open.
"""

import re
import resource
import signal
import sys
from contextlib import suppress
from itertools import islice

import msgspec
import pyoxigraph as ox

from companion.asking import PREFIXES, Answer, Question, Refused, Rows, Term, Triple, Verdict
from services.knowledge.beliefs import believed, dataset

MEMORY_BYTES = 2 * 1024**3
"""Beside a robot's own processes; estimate. A recording of a pour and its answer take a tenth of
it.
"""

_SERVICE = re.compile("service", re.IGNORECASE)


def answer(question: Question) -> Answer:
    """The answer, from what km had received."""
    text, triples = question.text, dataset(believed(question.heard), question.begin)
    bound(question.seconds)
    try:
        if asks_another_store(text):
            return Refused(
                "SERVICE asks another store over the network, and `roco ask` asks only this one;"
                " leave the word away"
            )
        return _answer(triples.query(text, prefixes=PREFIXES), question.rows)
    except SyntaxError as error:
        if is_update(text):
            return Refused(
                "this is empty or would change what km knows, and `roco ask` only reads; write"
                " SELECT or ASK"
            )
        return Refused(f"this is not SPARQL: {error}; write SELECT or ASK")


def asks_another_store(text: str) -> bool:
    """Whether SERVICE is a keyword of the query: it is if the text is no query with another word in
    its place.

    Raise SyntaxError if the text is no query as it is. Parsing evaluates on an empty store: call
    `bound` before.
    """
    if not _SERVICE.search(text):
        return False
    _parse(text)
    try:
        _parse(_SERVICE.sub(lambda found: f"{found[0][:3]}x{found[0][3:]}", text))
    except SyntaxError:
        return True
    return False


def _parse(text: str) -> None:
    with suppress(OSError, RuntimeError):  # of the evaluation
        ox.Store().query(text, prefixes=PREFIXES)


def is_update(text: str) -> bool:
    """Whether the text is a SPARQL update, or has no query at all. It changes an empty store: call
    `bound` before.
    """
    try:
        # of the evaluation: LOAD opens no socket, and there is no graph to move
        with suppress(OSError, RuntimeError):
            ox.Store().update(text, prefixes=PREFIXES)
    except SyntaxError:
        return False
    return True


def bound(seconds: float) -> None:
    """From here on this process lives that long at most, and opens nothing more: no SERVICE reaches
    the network.
    """
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))
    resource.setrlimit(resource.RLIMIT_NOFILE, (0, 0))
    signal.setitimer(signal.ITIMER_REAL, seconds)


def _answer(found: ox.QuerySolutions | ox.QueryBoolean | ox.QueryTriples, most: int) -> Answer:
    if isinstance(found, ox.QueryBoolean):
        return Verdict(bool(found))
    if isinstance(found, ox.QueryTriples):
        return Refused(
            "CONSTRUCT and DESCRIBE give a graph, and `roco ask` gives rows; write SELECT or ASK"
        )
    columns = tuple(variable.value for variable in found.variables)
    rows = tuple(
        tuple(None if value is None else _term(value) for value in solution)
        for solution in islice(found, most)
    )
    return Rows(columns, rows, next(found, None) is not None)


def _term(value: object) -> Term:
    match value:
        case ox.NamedNode():
            return Term("uri", value.value)
        case ox.BlankNode():
            return Term("bnode", value.value)
        case ox.Literal(language=str(language)):
            return Term("literal", value.value, lang=language, direction=str(value.direction or ""))
        case ox.Literal():
            plain = value.datatype.value == f"{PREFIXES['xsd']}string"
            return Term("literal", value.value, "" if plain else value.datatype.value)
        case ox.Triple():
            return Term("triple", Triple(*map(_term, value)))
    raise TypeError(f"a {type(value).__name__} is no value of a row")


if __name__ == "__main__":
    question = msgspec.msgpack.decode(sys.stdin.buffer.read(), type=Question)
    sys.stdout.buffer.write(msgspec.msgpack.encode(answer(question)))
