"""What became of a task, in a plain sentence; its plans with their course and reasons: rejected
alternatives, reasons for new plans, suspensions.
"""

from collections import defaultdict
from collections.abc import Iterator

from companion import commands
from companion.asking import PREFIXES, Question, Rows, Term
from companion.design import AgentName
from companion.languages import cmd, hfsm, rc, sw, wm
from companion.languages.facts import Facts, Kind, fact
from companion.languages.values import Side
from companion.sentences import (
    Reader,
    amount,
    at,
    catalogue,
    does,
    evidence,
    failure,
    operator,
    person,
    plain,
    spaced,
)
from companion.tools.report.plans import REFUSED, Made, Ran, acts, made, outcome, ran, task_end
from companion.tools.verbs import ask
from companion.tools.verbs.ask import written
from fipa_codec.performatives import Performative
from operate.recording.history import History
from operate.recording.records import Spoken
from operate.recording.run import Run
from operate.tracing.reasons import Fact, Passage, Why, record
from operate.tracing.trace import Message, Span, Trace

FOUND, CANCELLED = "found", "cancelled"


def of_task(run: Run, task: Span) -> tuple[str, tuple[Passage, ...]]:
    """What became of a task of a person; and how it waited and was switched, its plans, and how
    they went.
    """
    history, mark = run.talk, f"{task.conversation}-plan"
    plans = [one for one in made(history) if one.network.startswith(mark)]
    runs = [one for one in ran(history) if one.plan.startswith(mark)]
    return _became(history, task), (
        Passage("waiting and switching", tuple(_waiting(history, task, runs))),
        Passage("why these plans", tuple(fact for one in plans for fact in _planned(history, one))),
        Passage("how they went", tuple(fact for one in runs for fact in _went(history, one))),
    )


def _record(one: Spoken) -> str:
    return f"{one.channel} {one.sender} > {one.receiver} {one.performative}, id {one.id}"


# --- the sentence ---------------------------------------------------------------------------------


def _became(history: History, task: Span) -> str:
    """What a person asked for, what became of it, and why, for a person who knows no robots; "" for
    a conversation that is about no task.
    """
    said = history.conversation(task.conversation)
    command = next((one for one in said if isinstance(one.content, cmd.Command)), None)
    if command is None:
        return ""
    wish = commands.in_words(command.content, Reader.ENGLISH)
    words = catalogue(Reader.ENGLISH)
    end = task_end(history, command)
    if end is not None:
        state, why = outcome(end), getattr(end.content, "why", ())
        became = words.page["told_failed" if state == REFUSED else f"told_{state}"].format(wish)
        reasons = (failure if state == cmd.TaskState.FAILED else person)(why, Reader.ENGLISH)
        return f"{became} {reasons}".rstrip()
    reports = [one.content for one in said if isinstance(one.content, cmd.TaskReport)]
    last = reports[-1] if reports else cmd.TaskReport(cmd.TaskState.WAITING)
    now, reasons = words.state[last.state], person(last.why, Reader.ENGLISH)
    return words.hi["because"].format(wish, now, reasons).rstrip()


# --- waiting and switching ------------------------------------------------------------------------


def _waiting(history: History, task: Span, runs: list[Ran]) -> Iterator[Fact]:
    """Yield what co told of the task's place in its queue, and why it was left and taken up."""
    aside = False
    for one in history.conversation(task.conversation):
        report = one.content
        if not isinstance(report, cmd.TaskReport):
            continue
        if report.state is cmd.TaskState.WAITING:
            yield Fact(one.sent, f"co took it: {operator(report.why)}", _record(one))
        elif (
            report.state is cmd.TaskState.RUNNING
            and (left := _left(history, one, runs)) is not None
        ):
            yield Fact(
                left.sent, f"co asked ta to leave the plan: {operator(report.why)}", _record(left)
            )
        elif report.state is cmd.TaskState.SUSPENDED:
            yield Fact(one.sent, f"co put it aside: {operator(report.why)}", _record(one))
            aside = True
        elif aside and report.state is cmd.TaskState.PLANNING:
            yield Fact(one.sent, f"co took it up again: {operator(report.why)}", _record(one))
            aside = False


def _left(history: History, report: Spoken, runs: list[Ran]) -> Spoken | None:
    """The cancel of a plan that co said in the step of a report, so that the report gives the
    reason.
    """
    plans = {one.conversation for one in runs}
    of_step = (one for one in history.said if one.conversation in plans and one.sent == report.sent)
    return next((one for one in of_step if one.performative == Performative.CANCEL), None)


# --- plans ----------------------------------------------------------------------------------------


def _planned(history: History, plan: Made) -> Iterator[Fact]:
    name = plan.network.rpartition("-")[2].replace("plan", "plan ")
    said = history.conversation(plan.conversation)
    asked = next(one for one in said if isinstance(one.content, hfsm.GroundTaskNetwork))
    yield Fact(asked.sent, f"co asked pl for {name}: {plain(plan.task)}", _record(asked))
    plans = (one for one in said if isinstance(one.content, hfsm.HierarchicalPlan | hfsm.NoPlan))
    answer = next(plans, None)
    if answer is None:
        return
    record, content = _record(answer), answer.content
    for one in content.rejected:
        what = plain(f"{one.method.replace('_', ' ')} ({', '.join(one.arguments)})")
        yield Fact(
            answer.sent, f"pl rejected “{what}”: {operator(one.why) or 'it does not apply'}", record
        )
    if isinstance(content, hfsm.NoPlan):
        yield Fact(answer.sent, f"pl found no {name}: {operator(content.why)}", record)
        return
    steps = ", ".join(does(state) for state in content.root.states)
    asks = f"with {content.queries} answers of km, to take {content.duration:.0f} s"
    yield Fact(answer.sent, f"pl found {name} {asks}: {steps}", record)
    yield from (Fact(answer.sent, text, record) for text in _ends(content.root))


def _ends(machine: hfsm.Machine) -> Iterator[str]:
    """Yield why a plan is to end with another one, or with a failure if an act fails, where it says
    so.
    """
    succeeding = set(_succeeding(machine))
    for state in machine.states:
        if isinstance(state, hfsm.EndState):
            why = f": {operator(state.why)}" if state.why else ""
            how = "is to end" if state.name in succeeding else "ends, if an act fails,"
            yield f"the plan {how} with {state.outcome}{why}"
        elif isinstance(state, hfsm.Machine):
            yield from _ends(state)


def _succeeding(machine: hfsm.Machine) -> Iterator[str]:
    """Yield the states of a machine that are entered one after the other while each succeeds."""
    states, name = {state.name: state for state in machine.states}, machine.initial
    while name:
        yield name
        arcs: tuple[hfsm.Arc, ...] = getattr(states[name], "arcs", ())
        name = next((arc.to for arc in arcs if arc.on is hfsm.Outcome.SUCCEEDED), "")


def _went(history: History, plan: Ran) -> Iterator[Fact]:
    name = plan.plan.rpartition("-")[2].replace("plan", "plan ")
    mine = [one for one in acts(history) if one.command.key.startswith(f"{plan.plan}/")]
    for one in mine:
        if one.end is not None and not one.done:
            command: rc.Command = one.command
            what = " ".join(
                filter(None, (spaced(type(command).__name__), getattr(command, "object", "")))
            )
            yield Fact(
                one.end, f"ex did not do “{plain(what)}”: {one.reason}", f"act {command.key}"
            )
    said = reversed(history.conversation(plan.conversation))
    reports = [one for one in said if isinstance(one.content, sw.Report)]  # newest first
    last = next((one for one in reports if one.content.state in sw.FINAL), None)
    if last is None:
        return
    done = sum(one.done for one in mine)
    where = at(next((one.content.at for one in reports if one.content.at), None))
    reason = operator(last.content.why) or (f"at “{where}”" if where else "")
    after = f" after {done} act{'s' * (done != 1)}" if mine else ""
    words = f"ta ended {name} with {last.content.state}{after}" + (f": {reason}" if reason else "")
    yield Fact(last.sent, words, _record(last))
    yield from (
        Fact(last.sent, plain(evidence(one)), _record(last)) for one in last.content.evidence
    )


# --- Beliefs of km about a thing and since when: by which observation, told by whom, seen in which
# act


SECONDS, ROWS = 5.0, 1000
"""Bounds of a query, as of `roco ask`."""
THINGS = "SELECT DISTINCT ?thing WHERE { GRAPH ?said { ?thing a ?class } ?said a roco:Observation }"
BELIEFS = """SELECT ?subject ?relation ?value ?since
  WHERE {{ VALUES ?subject {{ thing:{0} content:{0} }}
  GRAPH ?said {{ ?subject ?relation ?value }} ?said a roco:Observation ; roco:toldAt ?since
  FILTER(?relation NOT IN (roco:record, roco:version, roco:observedAt, roco:relatedAt)) }}
  ORDER BY ?since ?relation"""
WORDS = {
    "type": "it is a {value}",
    "isInstanceOf": "it looks as the model “{value}”",
    "isIn": "it is in {value}",
    "isOn": "it stands on {value}",
    "isGraspedBy": "the {value} holds it",
    "isGraspedWith": "it is held by grasp {value}",
    "hasExactPose": "its pose is {value}",
    "isMoveable": "it {value} be moved",
    "contentSeen": "about {value} were seen in it",
    "placeDeviation": "its place is known to within {value}",
}
UNITS = {"contentSeen": "kg", "placeDeviation": "m"}
"""Units of values, by relation (roco.ttl)."""
TRUTH = {
    "hasExactPose": ("only predicted", "known as it was seen"),
    "isMoveable": ("cannot", "can"),
}
"""Words for false and for true."""
TRUE = ("true", "1")


def believed(run: Run, name: str, at: float | None = None) -> Why | None:
    """What is believed of a thing, now or `at` [s after the first communicate]; None for an unknown
    one.
    """
    known = ask.known(run, at)
    things = [_local(row[0]) for row in _asked(known, THINGS)]
    thing = next((one for one in things if name in (one, plain(one), one.partition("_")[0])), None)
    if thing is None:
        return None
    told: defaultdict[tuple[float, bool], list[str]] = defaultdict(list)
    beliefs = _asked(known, BELIEFS.format(thing))
    for subject, relation, value, since in beliefs:
        content = written(subject).startswith(PREFIXES["content"])
        if not (content and _local(relation) == "type"):
            told[float(written(since)), content].append(
                _sentence(_local(relation), value, content=content)
            )
    observed = (_observed(run, at, thing, texts, of) for (at, of), texts in told.items())
    facts = [fact for some in observed for fact in some]
    facts += _confirmed(run, thing, at)
    believed = (Passage("what is believed", tuple(facts)),)
    sentence = person(_where({_local(one[1]): _local(one[2]) for one in beliefs}, thing), "en")
    return Why(thing, f"{plain(thing)}: {known.words}", known.begin, believed, sentence)


def _where(beliefs: dict[str, str], thing: str) -> Facts:
    """Which hand holds a thing, else whether the robot sees where it is."""
    if hand := beliefs.get("isGraspedBy"):
        return (fact(Kind.HOLDS, Side(hand.removesuffix("_hand")), thing),)
    if exact := beliefs.get("hasExactPose"):
        return (fact(Kind.LOCALIZED if exact in TRUE else Kind.NOT_LOCALIZED, thing),)
    return ()


def _asked(known: ask.Known, text: str) -> list[list[Term]]:
    answer = ask.answered(Question(text, known.heard, known.begin, SECONDS, ROWS))
    assert isinstance(answer, Rows)
    return [[term for term in row if term is not None] for row in answer.rows]


def _local(term: Term) -> str:
    """The last part of an IRI, or a literal."""
    return written(term).rpartition("#")[2].rpartition("thing/")[2].rpartition(":")[2]


def _sentence(relation: str, value: Term, *, content: bool = False) -> str:
    word = plain(_local(value).rpartition("/")[2] if value.type == "uri" else written(value))
    if relation in TRUTH:
        word = TRUTH[relation][written(value) in TRUE]
    elif relation in UNITS:
        word = str(amount(float(written(value)), UNITS[relation], Reader.OPERATOR))
    elif relation == "type":
        word = spaced(word)
    text = WORDS.get(relation, f"{spaced(relation)} {{value}}").format(value=word.replace("_", " "))
    return text.replace("it is", "its content is", 1) if content else text


# --- the observation ------------------------------------------------------------------------------


def _observed(run: Run, since: float, thing: str, texts: list[str], content: bool) -> list[Fact]:
    """What is believed since one observation, and where that is from; `content`: of what was in the
    thing.
    """
    at = run.trace.begin + since
    to_km = (one for one in run.talk.said if one.receiver == AgentName.KM)
    said = [one for one in to_km if abs(one.received - at) < 0.001]
    of_thing = (one for one in said if _tells(one, thing))
    about = [one for one in of_thing if isinstance(one.content, wm.FeltContent) is content] or said
    message = run.trace.messages.get(about[-1].identity) if about else None
    words = "; ".join(texts)
    if message is None:
        return [Fact(at, words)]
    first = Fact(at, words, record(message))
    return [first, Fact(message.sent, _source(run.trace, message), record(message))]


def _source(trace: Trace, told: Message) -> str:
    """Who told an observation, and in which act it was made, as far as a step log says."""
    seen = trace.messages.get(told.cause) if told.cause is not None else None
    text = f"{told.sender} told {told.receiver} so ({told.id.partition('@')[0]})"
    act = next((one for one in trace.spans if seen is not None and seen in one.messages), None)
    if seen is None or act is None:
        return text
    during = f" at the end of “{act.text}”" if act.text else ""
    return f"{text}; {seen.sender} had reported it{during}" + (
        " (by time)" if told.known == "time" else ""
    )


def _tells(one: Spoken, thing: str) -> bool:
    names = (getattr(one.content, name, "") for name in ("object", "source"))
    return isinstance(one.content, wm.AnySight) and thing in names


def _confirmed(run: Run, thing: str, at: float | None) -> list[Fact]:
    """When the thing was seen or felt last."""
    until = float("inf") if at is None else run.trace.begin + at
    to_km = (one for one in run.talk.said if one.receiver == AgentName.KM and one.received <= until)
    said = [one for one in to_km if _tells(one, thing)]
    if not said:
        return []
    last = run.trace.messages[said[-1].identity]
    text = f"{last.sender} told {last.receiver} of it last: {last.text}"
    return [Fact(last.sent, text, record(last))]
