"""Beliefs of km about a thing and since when: by which observation, told by whom, seen in which act.

Asked of km's own dataset, as by `roco ask`; the observation is the message of that time in the trace.
"""

from collections import defaultdict

from companion.asking import PREFIXES, Question, Rows, Term
from companion.languages import wm
from companion.tools import asking
from companion.tools.asking import KM, written
from companion.wording import plain, spaced
from operate.recording.records import Spoken
from operate.recording.run import Run
from operate.tracing.reasons import Fact, Passage, Why, record
from operate.tracing.trace import Message, Trace

SECONDS, ROWS = 5.0, 1000
"""Bounds of a query, as of `roco ask`."""
THINGS = "SELECT DISTINCT ?thing WHERE { GRAPH ?said { ?thing a ?class } ?said a roco:Observation }"
BELIEFS = """SELECT ?subject ?relation ?value ?since WHERE {{ VALUES ?subject {{ thing:{0} content:{0} }}
  GRAPH ?said {{ ?subject ?relation ?value }} ?said a roco:Observation ; roco:toldAt ?since
  FILTER(?relation NOT IN (roco:record, roco:version, roco:observedAt, roco:relatedAt)) }} ORDER BY ?since ?relation"""
WORDS = {
    "type": "it is a {value}",
    "isInstanceOf": "it looks as the model “{value}”",
    "isIn": "it is in {value}",
    "isOn": "it stands on {value}",
    "isGraspedBy": "the {value} holds it",
    "isGraspedWith": "it is held by grasp {value}",
    "hasExactPose": "its pose is {value}",
    "isMoveable": "it {value} be moved",
    "contentSeen": "about {value} kg were seen in it",
    "placeDeviation": "its place is known to within {value} m",
}
TRUTH = {"hasExactPose": ("only predicted", "known as it was seen"), "isMoveable": ("cannot", "can")}
"""Words for false and for true."""


def believed(run: Run, name: str, at: float | None = None) -> Why | None:
    """Return what is believed of a thing, now or `at` [s after the first communicate]; None for an unknown one."""
    known = asking.known(run, at)
    thing = next((one for one in _things(known) if name in (one, plain(one), one.partition("_")[0])), None)
    if thing is None:
        return None
    told: defaultdict[tuple[float, bool], list[str]] = defaultdict(list)
    for subject, relation, value, since in _asked(known, BELIEFS.format(thing)):
        content = written(subject).startswith(PREFIXES["content"])
        if not (content and _local(relation) == "type"):
            told[float(written(since)), content].append(_sentence(_local(relation), value, content=content))
    facts = [fact for (since, content), texts in told.items() for fact in _observed(run, since, thing, texts, content)]
    facts += _confirmed(run, thing, at)
    return Why(thing, f"{plain(thing)}: {known.words}", known.begin, (Passage("what is believed", tuple(facts)),))


def _things(known: asking.Known) -> list[str]:
    return [_local(row[0]) for row in _asked(known, THINGS)]


def _asked(known: asking.Known, text: str) -> list[list[Term]]:
    answer = asking.answered(Question(text, known.heard, known.begin, SECONDS, ROWS))
    assert isinstance(answer, Rows)
    return [[term for term in row if term is not None] for row in answer.rows]


def _local(term: Term) -> str:
    """Return the last part of an IRI, or a literal."""
    return written(term).rpartition("#")[2].rpartition("thing/")[2].rpartition(":")[2]


def _sentence(relation: str, value: Term, *, content: bool = False) -> str:
    word = plain(_local(value).rpartition("/")[2] if value.type == "uri" else written(value))
    if relation in TRUTH:
        word = TRUTH[relation][written(value) in ("true", "1")]
    elif relation == "type":
        word = spaced(word)
    text = WORDS.get(relation, f"{spaced(relation)} {{value}}").format(value=word.replace("_", " "))
    return text.replace("it is", "its content is", 1) if content else text


# --- the observation --------------------------------------------------------------------------------------------------


def _observed(run: Run, since: float, thing: str, texts: list[str], content: bool) -> list[Fact]:
    """Return what is believed since one observation, and where that is from; `content`: of what was in the thing."""
    at = run.trace.begin + since
    said = [one for one in run.history.said if one.receiver == KM and abs(one.received - at) < 0.001]
    about = [one for one in said if _tells(one, thing) and isinstance(one.content, wm.FeltContent) is content] or said
    message = run.trace.messages.get(about[-1].identity) if about else None
    words = "; ".join(texts)
    if message is None:
        return [Fact(at, words)]
    return [Fact(at, words, record(message)), Fact(message.sent, _source(run.trace, message), record(message))]


def _source(trace: Trace, told: Message) -> str:
    """Return by whom an observation was told, and in which act it was made, as far as a step log says."""
    seen = trace.messages.get(told.cause) if told.cause is not None else None
    text = f"{told.sender} told {told.receiver} so ({told.id.partition('@')[0]})"
    act = next((one for one in trace.spans if seen is not None and seen in one.messages), None)
    if seen is None or act is None:
        return text
    during = f" at the end of “{act.text}”" if act.text else ""
    return f"{text}; {seen.sender} had reported it{during}" + (" (by time)" if told.known == "time" else "")


def _tells(one: Spoken, thing: str) -> bool:
    names = (getattr(one.content, name, "") for name in ("object", "source"))
    return isinstance(one.content, wm.AnySight) and thing in names


def _confirmed(run: Run, thing: str, at: float | None) -> list[Fact]:
    """Return when the thing was seen or felt last."""
    until = float("inf") if at is None else run.trace.begin + at
    said = [one for one in run.history.said if one.receiver == KM and one.received <= until and _tells(one, thing)]
    if not said:
        return []
    last = run.trace.messages[said[-1].identity]
    return [Fact(last.sent, f"{last.sender} told {last.receiver} of it last: {last.text}", record(last))]
