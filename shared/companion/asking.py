"""A question in SPARQL to what km was told: what `roco ask` and the process that answers it
exchange, in msgpack.

The process is `python -m services.knowledge.asked`: it can be ended, and only it needs the extra
`knowledge`.
"""

import msgspec

ANSWERER = "services.knowledge.asked"
_OURS = "urn:robot-companion:"
PREFIXES = {
    "roco": f"{_OURS}roco#",
    "thing": f"{_OURS}thing/",
    "content": f"{_OURS}content/",
    "model": f"{_OURS}model/",
    "grasp": f"{_OURS}grasp/",
    "agent": f"{_OURS}agent/",
    "said": f"{_OURS}said/",
    "state": f"{_OURS}state/",
    "rdf": "http://www.w3.org/1999/02/22-rdf-syntax-ns#",
    "rdfs": "http://www.w3.org/2000/01/rdf-schema#",
    "owl": "http://www.w3.org/2002/07/owl#",
    "xsd": "http://www.w3.org/2001/XMLSchema#",
    "dul": "http://www.ontologydesignpatterns.org/ont/dul/DUL.owl#",
    "soma": "http://www.ease-crc.org/ont/SOMA.owl#",
    "cora": "http://purl.org/ieee1872-owl/cora-bare#",
    "pos": "http://purl.org/ieee1872-owl/pos#",
}
"""Filled in for each question. Of ours: terms of O_RoCo, things, what was in a thing, models and
their grasps, agents, observations, hypothetical states.
"""


class Heard(msgspec.Struct, frozen=True):
    """A communicate from or to km; `at`: when it was heard [unix s]. Without bytes: another life of
    km began.
    """

    at: float
    wire: bytes = b""


class Question(msgspec.Struct, frozen=True):
    """SPARQL, what km heard and said until the time it is asked of, and the bounds: time [s] of the
    query, rows.

    `begin`: when the first communicate of the run was heard [unix s].
    """

    text: str
    heard: tuple[Heard, ...]
    begin: float
    seconds: float
    rows: int


class Term(msgspec.Struct, frozen=True, omit_defaults=True):
    """A value, as the W3C's "SPARQL 1.2 Query Results JSON Format" writes it; `type`: uri, bnode,
    literal or triple.
    """

    type: str
    value: "str | Triple"
    datatype: str = ""
    lang: str = msgspec.field(name="xml:lang", default="")
    direction: str = msgspec.field(name="its:dir", default="")


class Triple(msgspec.Struct, frozen=True):
    """The value of a triple term."""

    subject: Term
    predicate: Term
    object: Term


class Rows(msgspec.Struct, frozen=True, tag=True):
    """The answer to SELECT: a value or nothing per column and row. `cut`: there are more rows."""

    columns: tuple[str, ...]
    rows: tuple[tuple[Term | None, ...], ...]
    cut: bool


class Verdict(msgspec.Struct, frozen=True, tag=True):
    """The answer to ASK."""

    holds: bool


class Refused(msgspec.Struct, frozen=True, tag=True):
    """The question is not answered: why, and what would be."""

    why: str


Answer = Rows | Verdict | Refused
