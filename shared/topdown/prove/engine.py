"""Looks at every state of a model, breadth first, and gives the shortest way to whatever is wrong.

Three things are looked for: a state the model calls wrong; a deadlock (nothing but faults can
happen, and it is not at rest); and a state from which rest is out of reach by moves that are fair,
that is, neither faults nor somebody's free choice. Nothing is explored beyond a wrong state or a
deadlock. A search that stops at a limit takes what it has not looked at for good: its findings are
wrong whatever lies there. States are numbered as they are found, and edges are kept as numbers
only, so that millions fit into memory. A finding is drawn as a sequence diagram in text. Must not
know: what a model is about.
"""

import re
import textwrap
import time
from array import array
from collections import deque
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from contextlib import closing
from itertools import pairwise, zip_longest
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

from topdown.prove.flat import Explorer, Status, TooLarge, explorer

if TYPE_CHECKING:
    from topdown.prove.batches import Batches

State = Any
"""Anything hashable; two states are the same if they are equal. Flat tuples of small integers are
fastest.
"""

LOOK_AT_CLOCK = 1024
"""States between two looks at the clock (estimate: 0.1 s at the slowest)."""
TELL_EVERY_S = 0.5
FEW = 20_000
"""States up to which the loop in Python is faster than numpy (estimate)."""


class Move(NamedTuple):
    """`who` does `what` and the state is `there`.

    `fair`: counts when asked whether rest can be reached; a fault, a person's free choice and a
    repetition do not. `fault`: of the surroundings, so nobody may wait for it. Words in `what` that
    drawings understand: "request -> ta" is sent to another lifeline, "request <- co" is taken from
    one.
    """

    who: str
    what: str
    there: State
    fair: bool = True
    fault: bool = False


class Model(Protocol):
    """A model that `explore` can explore."""

    @property
    def start(self) -> State:
        """The first state."""

    def moves(self, state: State) -> Iterable[Move]:
        """All that can happen in a state; a plain tuple of a Move's five fields will do, and is
        quicker made.
        """

    def at_rest(self, state: State) -> bool:
        """Whether all may stay as it is for ever."""

    def wrong(self, state: State) -> str:
        """Return the fault of this state by itself, in words; "" for none. Nothing is explored
        beyond it.
        """

    def describe(self, state: State) -> dict[str, str]:
        """Agent -> its state in words, for drawing traces."""


class Step(NamedTuple):
    """One move of a trace, and everybody's state after it."""

    who: str
    what: str
    after: Mapping[str, str]


DEADLOCK, WRONG, UNREACHED = "deadlock", "wrong", "rest out of reach"
DEAD = "nothing can happen any more, and not all is at rest"
OUT_OF_REACH = "from here no fair moves lead to rest"


class Finding(NamedTuple):
    """`kind`: DEADLOCK, WRONG or UNREACHED; `trace`: a shortest way from the start, where all were
    as in `start`; `causes`: what is missing there, where that was looked for.
    """

    kind: str
    text: str
    trace: tuple[Step, ...]
    start: Mapping[str, str]
    causes: tuple[str, ...] = ()

    def __str__(self) -> str:
        numbered = enumerate(self.trace, start=1)
        steps = (f"{number:3}. {step.who}: {step.what}" for number, step in numbered)
        return "\n".join((f"{self.kind}: {self.text}", *steps))


class Exploration(NamedTuple):
    """Result of an exploration. `complete`: every state was looked at; if not, `unproven` says what
    is open.

    `seconds`: wall time; `cpu_s`: of the processor. `findings`: one for each different text,
    shortest trace first. `reached`: all states, `met`: what was met at places of states, where that
    was asked for.
    """

    states: int
    edges: int
    seconds: float
    complete: bool
    unproven: str
    findings: tuple[Finding, ...]
    reached: Collection[State] = ()
    met: Mapping[int, Collection[Any]] = MappingProxyType({})
    cpu_s: float = 0.0

    @property
    def holds(self) -> bool:
        """Nothing was found, and nothing is open."""
        return self.complete and not self.findings


def explore(
    model: Model,
    *,
    most_states: int | None = None,
    seconds: float | None = None,
    progress: Callable[[int, int], None] | None = None,
    first: bool = True,
    keep: bool = False,
    places: Collection[int] = (),
) -> Exploration:
    """Explore a model: stop at `most_states` known states, `seconds` of CPU time, or (`first`) its
    first finding.

    `progress(states, waiting)` is called about twice a second. `keep`: hand out all states in
    `Exploration.reached`. `places`: where states are tuples, what was met at these places, in
    `Exploration.met`. A model that has tables (flat.Tabled) is explored in C, where that is built.
    """
    limits = _Limits(most_states or 1 << 31, float("inf") if seconds is None else seconds, first)
    walk = _Walk(model, limits, progress)
    search: Explorer | Batches | None = None if keep else explorer(model)
    if search is None and not keep and not walk.run(FEW):
        search = _batched(model, limits)
    if search is not None:
        try:
            with closing(search):
                return _explored(_TabledWalk(model, limits, progress, search), places)
        except TooLarge:
            pass  # the other one has no such bounds
    found = _explored(walk, places)
    return found._replace(reached=walk.numbers.keys()) if keep else found


def _batched(model: Model, limits: "_Limits") -> "Explorer | Batches | None":
    """The explorer with numpy, where that is installed."""
    try:
        from topdown.prove.batches import LARGEST, batched
    except ImportError:
        return None
    return batched(model, limits.first, LOOK_AT_CLOCK if limits.most < 1 << 31 else LARGEST)


def _explored(walk: "_Walk", places: Collection[int]) -> Exploration:
    walk.run()
    if not (walk.limits.first and walk.findings):
        walk.look_back()
    return Exploration(
        states=walk.known,
        edges=walk.edges,
        seconds=time.perf_counter() - walk.began,
        complete=walk.complete,
        unproven=walk.unproven,
        findings=tuple(sorted(walk.findings.values(), key=lambda finding: len(finding.trace))),
        met={place: walk.met(place) for place in places},
        cpu_s=time.thread_time() - walk.began_cpu,
    )


class _Limits(NamedTuple):
    most: int
    seconds: float
    first: bool


class _Walk:
    """`numbers`: every state found, in order; `parents`: of each but the first; `fair`: the numbers
    of the states that fair moves lead to, those of state n from `begin[n]` on; `good`: at rest (or
    looked at no further).
    """

    def __init__(
        self,
        model: Model,
        limits: _Limits,
        progress: Callable[[int, int], None] | None,
    ) -> None:
        self.model, self.limits, self.progress = model, limits, progress
        self.numbers: dict[State, int] = {model.start: 0}
        self.parents, self.fair, self.begin = array("I", [0]), array("I"), array("Q", [0])
        self.good = array("I")
        self.edges, self.complete, self.unproven = 0, False, ""
        self.findings: dict[tuple[str, str], Finding] = {}
        self.dead: set[int] = set()
        self.began = self.told = time.perf_counter()
        self.began_cpu = time.thread_time()
        self.waiting: deque[State] = deque([model.start])

    def run(self, most: int | None = None) -> bool:
        """Breadth first until nothing is left, or a limit is met; False: more than `most` states
        are known, and the next call goes on.
        """
        waiting = self.waiting
        while waiting:
            if self._ended():
                return True
            here = self.looked_at
            if here % LOOK_AT_CLOCK == 0:
                if self._limited(len(waiting)):
                    return True
                if most is not None and self.known > most:
                    return False
            self._look(here, waiting.popleft(), waiting)
        self.complete = not self._ended()
        return True

    def _ended(self) -> bool:
        ended = self.limits.first and bool(self.findings)
        if ended:
            self.unproven = "the search ended at its first finding; what else is wrong is open"
        return ended

    @property
    def known(self) -> int:
        """How many states were found."""
        return len(self.numbers)

    def met(self, place: int) -> frozenset[Any]:
        """All that was met at a place of a state."""
        return frozenset(state[place] for state in self.numbers)

    @property
    def looked_at(self) -> int:
        """Number of the first state that was not looked at: those known, but not looked at, are the
        newest.
        """
        return len(self.begin) - 1

    def _look(self, here: int, state: State, waiting: deque[State]) -> None:
        wrong = self.model.wrong(state)
        rest = not wrong and self.model.at_rest(state)
        if wrong or rest:
            self.good.append(here)
        if wrong:
            self._find(WRONG, wrong, here)
        else:
            moves = tuple(self.model.moves(state))
            if rest or not all(move[4] for move in moves):
                self._go_on(here, moves, waiting)
            else:
                self.dead.add(here)
                self._find(DEADLOCK, DEAD, here)
        self.begin.append(len(self.fair))

    def _go_on(self, here: int, moves: tuple[Move, ...], waiting: deque[State]) -> None:
        """Note every move."""
        numbers, fair_ones = self.numbers, self.fair
        for _, _, there, fair, fault in moves:
            self.edges += 1
            number = numbers.get(there)
            if number is None:
                number = numbers[there] = len(numbers)
                self.parents.append(here)
                waiting.append(there)
            if fair and not fault:
                fair_ones.append(number)

    def _limited(self, waiting: int) -> bool:
        """Look at the clock and the count: whether to stop."""
        now, known = time.perf_counter(), self.known
        if self.progress is not None and now - self.told > TELL_EVERY_S:
            self.told = now
            self.progress(known, waiting)
        over = time.thread_time() - self.began_cpu > self.limits.seconds
        if over or known > self.limits.most:
            limit = f"{self.limits.seconds:g} CPU seconds" if over else f"{self.limits.most} states"
            self.unproven = (
                f"stopped at the limit of {limit}: {known} states known, {waiting} of"
                " them not looked at; open is whether a deadlock or a wrong state lies beyond"
                " them, and whether rest is in reach from there"
            )
            return True
        return False

    # --- backwards --------------------------------------------------------------------------------

    def look_back(self) -> None:
        """From states at rest, or not looked at, backwards over fair moves; the first not met is a
        finding.
        """
        good = self._reaching()
        here = good.find(0)
        while here >= 0:
            if here not in self.dead:
                self._find(UNREACHED, OUT_OF_REACH, here)
                return
            here = good.find(0, here + 1)

    def _reaching(self) -> bytearray:
        """1 for each state from which fair moves lead to rest."""
        begin, before = self._predecessors()
        good, waiting = bytearray(len(self.numbers)), self.good
        waiting.extend(range(self.looked_at, len(self.numbers)))
        for number in waiting:
            good[number] = 1
        while waiting:
            there = waiting.pop()
            for here in before[begin[there] : begin[there + 1]]:
                if not good[here]:
                    good[here] = 1
                    waiting.append(here)
        return good

    def _predecessors(self) -> "tuple[array[int], array[int]]":
        """The fair moves turned round, by a counting sort: those into state n stand from begin[n]
        to begin[n + 1].
        """
        begin = array("Q", bytes(8 * (len(self.numbers) + 2)))
        for there in self.fair:
            begin[there + 2] += 1
        for number in range(2, len(begin)):
            begin[number] += begin[number - 1]
        before = array("I", bytes(4 * len(self.fair)))
        for here in range(self.looked_at):
            for there in self.fair[self.begin[here] : self.begin[here + 1]]:
                before[begin[there + 1]] = here
                begin[there + 1] += 1
        return begin, before

    # --- findings ---------------------------------------------------------------------------------

    def _find(self, kind: str, text: str, number: int) -> None:
        if (kind, text) in self.findings:
            return
        way = [number]
        while way[-1]:
            way.append(self._parent(way[-1]))
        states = self._states(set(way))
        way.reverse()
        steps = []
        for here, there in ((states[one], states[other]) for one, other in pairwise(way)):
            who, what, *_ = next(move for move in self.model.moves(here) if move[2] == there)
            steps.append(Step(who, what, self.model.describe(there)))
        start = self.model.describe(self.model.start)
        self.findings[kind, text] = Finding(kind, text, tuple(steps), start)

    def _parent(self, number: int) -> int:
        return self.parents[number]

    def _states(self, wanted: Collection[int]) -> dict[int, State]:
        return {n: state for n, state in enumerate(self.numbers) if n in wanted}


class _TabledWalk(_Walk):
    """The same by an explorer over tables, which has the states."""

    def __init__(
        self,
        model: Model,
        limits: _Limits,
        progress: Callable[[int, int], None] | None,
        search: "Explorer | Batches",
    ) -> None:
        super().__init__(model, limits, progress)
        self.search = search

    def run(self, most: int | None = None) -> bool:
        """Breadth first until nothing is left, or a limit is met."""
        now, texts = self.search.now, self.search.tables.texts.values
        while (status := self.search.run()) is not Status.DONE:
            if status is Status.PAUSE and self._limited(now.states - now.looked):
                break
            if status is Status.FOUND:
                kind = WRONG if now.text >= 0 else DEADLOCK
                self._find(kind, texts[now.text] if now.text >= 0 else DEAD, now.number)
                if self._ended():
                    break
        self.complete = status is Status.DONE
        self.edges = now.edges
        return True

    @property
    def known(self) -> int:
        """How many states were found."""
        return int(self.search.now.states)

    def met(self, place: int) -> frozenset[Any]:
        """All that was met at a place of a state."""
        return self.search.met(place)

    def look_back(self) -> None:
        """The first state from which no fair moves lead to rest is a finding."""
        here = self.search.stuck()
        if here >= 0:
            self._find(UNREACHED, OUT_OF_REACH, here)

    def _parent(self, number: int) -> int:
        return self.search.parent(number)

    def _states(self, wanted: Collection[int]) -> dict[int, State]:
        return {number: self.search.state(number) for number in wanted}


# --- A counterexample as a sequence diagram with states, as text for a terminal -------------------
# A message that is sent and one that is taken are two steps, maybe far apart, so each is half an
# arrow: it leaves its sender, or arrives at its receiver. What happens to one agent alone stands
# at its lifeline; states stand where they change.


MARGIN = 5
"""Columns for the number of a step."""
NARROWEST, WIDEST = 18, 40
_ARROW = re.compile(r"(?P<text>.+?) (?P<way>->|<-) (?P<peer>.+)")


class Part(NamedTuple):
    """Part of a step: `way` "->" sent to `peer`, "<-" taken from it, "" an event of its own."""

    text: str
    way: str = ""
    peer: str = ""


def parts(step: Step, lifelines: list[str]) -> Iterator[Part]:
    """The parts of a step in their order; words without a peer that has a lifeline stay
    together.
    """
    own: list[str] = []
    for piece in re.split(r"[;,] ", step.what):
        match = _ARROW.fullmatch(piece)
        if match and match["peer"] in lifelines and match["peer"] != step.who:
            text, way, peer = match["text"], match["way"], match["peer"]
            if abs(lifelines.index(peer) - lifelines.index(step.who)) != 1:
                text += f" {'to' if way == '->' else 'from'} {peer}"
            yield Part(text, way, peer)
        else:
            own.append(piece)
    if own:
        yield Part(", ".join(own))


class _Sheet:
    """Lines of text with lifelines in them."""

    def __init__(self, names: list[str], width: int) -> None:
        self.names = names
        self.column = max(NARROWEST, min(WIDEST, (width - MARGIN) // max(1, len(names))))
        self.width = MARGIN + self.column * len(names)
        self.places = {name: MARGIN + self.column * number for number, name in enumerate(names)}
        self.lines: list[str] = []

    def line(self, texts: list[tuple[int, str]], lifelines: bool = True) -> None:
        """One line: each text from its column on, the lifelines behind them."""
        cells = [" "] * (self.width + self.column)
        for place in self.places.values() if lifelines else ():
            cells[place] = "|"
        for place, text in texts:
            start = max(0, place)
            cells[start : start + len(text)] = list(text)[: len(cells) - start]
        self.lines.append("".join(cells).rstrip())

    def part(self, who: str, part: Part) -> None:
        """Half an arrow, or an event."""
        here = self.places[who]
        if not part.way:
            lines = textwrap.wrap(part.text, max(self.width - here - 2, 12)) or [""]
            for number, line in enumerate(lines):
                self.line([(here, ("| " if number else "* ") + line)])
            return
        right = self.places[part.peer] > here
        room = (self.width - here if right else here - MARGIN) - 7
        arrow = f"--{part.text if len(part.text) <= room else part.text[: room - 1] + '…'}--"
        leaves = part.way == "->"
        tail = f"{arrow}>" if leaves == right else f"<{arrow}"
        self.line([(here, f"o{tail}") if right else (here - len(tail), f"{tail}o")])

    def states(self, states: Mapping[str, str]) -> None:
        """The new states, each at its lifeline, in brackets."""
        room = self.column - 2
        wrapped = [textwrap.wrap(f"[{state}]", room) if state else [] for state in states.values()]
        places = [self.places[name] for name in states]
        for number, row in enumerate(zip_longest(*wrapped, fillvalue="")):
            indent = 1 if number else 0
            self.line([(at + indent, text) for at, text in zip(places, row, strict=True) if text])


def as_text(finding: Finding, width: int = 100) -> str:
    """A sequence diagram at most `width` columns wide, if the lifelines have room in it."""
    # all who are in a state, then those who only do something (a wire)
    names = list(dict.fromkeys([*finding.start, *(step.who for step in finding.trace)]))
    sheet = _Sheet(names, width)
    head, *told = finding.text, *finding.causes
    if told and finding.text in (DEAD, OUT_OF_REACH):
        head, *told = told  # the cause says more
    sheet.lines += textwrap.wrap(f"{finding.kind}: {head}", width)
    for cause in told:
        sheet.lines += textwrap.wrap(cause, width, initial_indent="-> ", subsequent_indent="   ")
    sheet.line([(sheet.places[name], name) for name in names], lifelines=False)
    sheet.states(finding.start)
    before = finding.start
    for number, step in enumerate(finding.trace, start=1):
        first = len(sheet.lines)
        for part in parts(step, names):
            sheet.part(step.who, part)
        sheet.lines[first] = f"{number:>3}" + sheet.lines[first][3:]
        sheet.states({who: now for who, now in step.after.items() if before.get(who) != now})
        before = step.after
    return "\n".join(sheet.lines)
