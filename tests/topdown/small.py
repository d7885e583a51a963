"""Small designs for the tests of rows and of their composition: a hand and a lamp, with rows as
each test has them.
"""

from collections import deque
from collections.abc import Iterable

from topdown.model import loading
from topdown.model.design import Design
from topdown.model.machines import Machine, machines
from topdown.prove.engine import DEADLOCK, UNREACHED, WRONG, Exploration, explore
from topdown.prove.fleet import Faults, Flat, Fleet
from topdown.prove.verify import Verdict, tasks

HEAD = """
format = 2

[system]
name = "lamp"
root = "all"
key = "{system}/{channel}/{sender}/{receiver}/{protocol}/{performative}"

[[requirement]]
id = "R1"
text = "switch a lamp, and know whether it is lit"

[[step]]
requirements = ["R1"]
divide = { group = "all", into = ["hand", "lamp"] }
tasks = [{ group = "hand", text = "asks" }, { group = "lamp", text = "shines" }]
channels = [{ id = "C1", between = ["hand", "lamp"], transmits = "on and off" }]

[[language]]
name = "L"

[[interface]]
name = "none"
entries = []
"""
TENDERED = "propose refuse inform failure"
USES = {
    "switch": ("request", True, False, "request cancel", "agree refuse inform failure"),
    "later": ("request-when", True, False, "request-when cancel", "agree refuse inform failure"),
    "ask": ("query", False, False, "query-ref", "inform failure"),
    "watch": ("subscribe", False, True, "subscribe cancel", "agree refuse inform failure"),
    "tender": ("cfp", False, False, "cfp accept-proposal reject-proposal", TENDERED),
}
"""name -> (protocol, durable, latest, what hand says, what lamp says)."""
Rows = Iterable[str]
STUCK = (DEADLOCK, UNREACHED)
"""Kinds of findings where somebody waits for ever."""


def text(hand: Rows, lamp: Rows, *uses: str, more: str = "", hand_more: str = "") -> str:
    """A design file with these rows, one TOML table each, over these uses (none: `switch`)."""
    parts = [HEAD, *(_use(name) for name in uses or ("switch",))]
    parts += [
        agent("hand", "idle waiting asking", hand, hand_more),
        agent("lamp", "idle busy lit", lamp),
    ]
    return "\n".join((*parts, more))


def design(hand: Rows, lamp: Rows, *uses: str, more: str = "", hand_more: str = "") -> Design:
    """The same, read."""
    whole = text(hand, lamp, *uses, more=more, hand_more=hand_more)
    return Design(loading.read(whole), "small.toml", whole)


def machine(agent: str, rows: Rows, *uses: str, choice: str = "") -> Machine:
    """The machine of an agent of which all else is plain."""
    extra = f"choice = [{choice}]" if choice else ""
    if agent == "hand":
        return machines(design(rows, (), *uses, hand_more=extra))["hand"]
    return machines(design((), rows, *uses))["lamp"]


def fleet(made: Design, most: int = 0, **wish: object) -> Fleet:
    """The composed model."""
    return Fleet(made, Faults(most, **wish))  # type: ignore[arg-type]


def found(made: Design, most: int = 0, **wish: object) -> Exploration:
    """The result of its exploration; small designs need no more states than that."""
    return explore(fleet(made, most, **wish), most_states=50_000)


def _use(name: str) -> str:
    follows, durable, latest, hand, lamp = USES[name]
    words = {"hand": hand, "lamp": lamp}
    return use(name, follows, words, durable=durable, latest=latest)


def use(
    name: str, follows: str, words: dict[str, str], *, durable: bool = True, latest: bool = False
) -> str:
    """A use on channel C1; `words`: the acts of each side, the initiator first."""
    one, other = words
    messages = ", ".join(
        f'{{ sender = "{who}", performative = "{act}", language = "L" }}'
        for who, acts in words.items()
        for act in acts.split()
    )
    return f"""
[[protocol]]
name = "{name}"
channel = "C1"
follows = "{follows}"
initiator = "{one}"
participant = "{other}"
durable = {str(durable).lower()}
latest = {str(latest).lower()}
message = [{messages}]
"""


def agent(name: str, states: str, rows: Rows, more: str = "", talks: Iterable[str] = ()) -> str:
    """Its entry; `talks`: the uses that each state talks in, by its place."""
    talked = [f", talks = [{_list(one)}]" for one in talks] or [""] * len(states.split())
    listed = ", ".join(
        f'{{ name = "{state}", behaviour = "b", terminal = "t"{uses} }}'
        for state, uses in zip(states.split(), talked, strict=True)
    )
    return f"""
[[agent]]
name = "{name}"
initial = "idle"
state = [{listed}]
row = [{", ".join(rows)}]
{more}"""


def _list(words: str) -> str:
    return ", ".join(f'"{word.strip()}"' for word in words.split(",") if word.strip())


def row(states: str, on: str, **words: str) -> str:
    """A row of these states, as the file has it; lists with commas."""
    parts = [f"in = [{_list(states)}]", f'on = "{on}"']
    for field, told in words.items():
        single = field in ("to", "moves", "then")
        parts.append(f'{field} = "{told}"' if single else f"{field} = [{_list(told)}]")
    return "{ " + ", ".join(parts) + " }"


HAND = (
    '{ in = ["idle"], on = "person wish", say = ["switch request"], to = "waiting" }',
    '{ in = ["waiting"], on = "person regret", say = ["switch cancel"] }',
    '{ in = ["waiting"], on = "switch agree" }',
    '{ in = ["waiting"], on = "switch refuse", when = ["switch refused"], to = "idle" }',
    '{ in = ["waiting"], on = "switch refuse", when = ["switch overtaken"] }',
    '{ in = ["waiting"], on = "switch inform", when = ["switch done"], to = "idle" }',
    '{ in = ["waiting"], on = "switch inform", when = ["switch overtaken"] }',
    '{ in = ["waiting"], on = "switch inform[cancel]", to = "idle" }',
    '{ in = ["waiting"], on = "switch failure[cancel]", to = "idle" }',
)
"""Wants light, may regret it, and takes whatever comes of it."""
LAMP = (
    row("idle", "switch request", say="switch agree", moves="switch", to="busy"),
    '{ in = ["idle"], on = "switch request", say = ["switch refuse"] }',
    '{ in = ["busy"], on = "switch cancel", say = ["switch inform[cancel]"], to = "idle" }',
    row("busy", "own lit", when="switch agreed", say="switch inform", to="idle"),
)
"""Shines, or not; a cancel that comes too late is the runtime's to answer."""


def less(rows: tuple[str, ...], *words: str) -> tuple[str, ...]:
    """Without the rows that hold one of these words; each must be in some."""
    assert all(any(word in row for row in rows) for word in words), words
    return tuple(row for row in rows if not any(word in row for word in words))


def instead(rows: tuple[str, ...], old: str, new: str) -> tuple[str, ...]:
    """With other words in the first row that has them."""
    place = next(number for number, row in enumerate(rows) if old in row)
    return (*rows[:place], rows[place].replace(old, new), *rows[place + 1 :])


def kinds(made: Design, most: int = 0, **wish: object) -> set[str]:
    """The kinds of its first findings; none if all holds."""
    result = found(made, most, **wish)
    assert result.complete or result.findings
    return {one.kind for one in result.findings}


def wrong(made: Design, most: int = 0, **wish: object) -> str:
    """The text of the only finding, which must be of kind WRONG."""
    (one,) = found(made, most, **wish).findings
    assert one.kind == WRONG
    return one.text


def labels(made: Design, most: int = 0, **wish: object) -> set[str]:
    """Everything that can happen, in words."""
    model = fleet(made, most, **wish)
    return {f"{who}: {what}" for state in reached(model) for who, what, *_ in model.moves(state)}


def reached(model: Fleet) -> list[Flat]:
    """Every state that can be reached, but for those that are wrong and what is beyond them."""
    seen = dict.fromkeys([model.start])
    waiting = deque(seen)
    while waiting:
        for _, _, there, _, _ in model.moves(waiting.popleft()):
            if there not in seen and not model.wrong(there):
                seen[there] = None
                waiting.append(there)
    return list(seen)


ASKER = (
    '{ in = ["idle"], on = "own wonder", say = ["ask query-ref"], to = "asking" }',
    '{ in = ["asking"], on = "ask inform", to = "idle" }',
    '{ in = ["asking"], on = "restart", say = ["ask query-ref"] }',
    '{ in = ["asking"], on = "late ask", to = "idle" }',
)
ANSWERER = ('{ in = ["idle"], on = "ask query-ref", say = ["ask inform"] }',)


def questions(hand: tuple[str, ...] = ASKER, lamp: tuple[str, ...] = ANSWERER) -> Design:
    """One question at a time, over a channel that loses and doubles."""
    return design(hand, lamp, "ask")


WATCHER = (
    '{ in = ["idle"], on = "back lamp", drop = ["watch"], say = ["watch subscribe"] }',
    '{ in = ["idle"], on = "watch agree" }',
    '{ in = ["idle"], on = "watch inform" }',
)
WATCHED = (
    '{ in = ["idle", "busy", "lit"], on = "watch subscribe", say = ["watch agree"] }',
    '{ in = ["idle"], on = "own work", to = "busy" }',
    '{ in = ["busy"], on = "own done", owes = ["watch"], to = "lit" }',
    '{ in = ["lit"], on = "own seen", when = ["watch settled"], to = "idle" }',
)


def watching(
    hand: tuple[str, ...] = WATCHER, lamp: tuple[str, ...] = WATCHED, more: str = ""
) -> Design:
    """The lamp tells what became of it, and rests only when the hand knows."""
    return design(hand, lamp, "watch", more=more)


def steps(model: Fleet, state: Flat, *words: str) -> Flat:
    """The state after moves whose labels hold these words."""
    for one in words:
        state = next(there for _, what, there, _, _ in model.moves(state) if one in what)
    return state


def verdicts(made: Design, **wish: object) -> list[Verdict]:
    """All of its proof obligations, worked out."""
    return [task.run(None) for task in tasks(made, **wish)]  # type: ignore[arg-type]


SLOW = (
    '{ in = ["idle"], on = "ask query-ref", to = "busy" }',
    '{ in = ["busy"], on = "own thought", say = ["ask inform"], to = "idle" }',
)
"""A lamp that thinks before it answers."""
BORED = '{ in = ["asking"], on = "own bored", drop = ["ask"], to = "idle" }'
FLICKERS = row("busy", "own flicker", when="switch agreed", say="switch inform[progress]")
TOLD = '{ in = ["waiting"], on = "switch inform[progress]" }'
"""Progress of the lamp, without end, and the hand's row for it."""
