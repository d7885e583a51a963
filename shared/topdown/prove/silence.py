"""Words that change nothing: progress told and confirmed. They are proven to be so, and then left out of the model.

A word is silent where its receiver, in whatever state its table lets it come, stands as before after taking it, and
answers with silent words only. Left out as well is thus a queue that such words fill: who may say one over and over
is told (`endless`). The proof looks afterwards at every state that was reached (`Agent.take`), since rows
may miss a state.
"""

from collections.abc import Collection, Iterable, Iterator

from fipa_codec.tables import RECEIVE, SEND, Table, Way
from topdown.model.machines import Cause, Event, Machine, Row, Said


def silent_words(machines: Iterable[Machine], forbidden: frozenset[Said] = frozenset()) -> frozenset[Said]:
    """The greatest set of words of durable uses that are silent if all of the set are, but for those that a rule of the
    design forbids at times.
    """
    kept = tuple(machines)
    found = {said for machine in kept for said in _heard(machine)} - forbidden
    while True:
        loud = {said for machine in kept for said in _heard(machine) & found if not _is_silent(machine, said, found)}
        if not loud:
            return frozenset(found)
        found -= loud


def endless(machine: Machine, silent: Collection[Said]) -> Iterator[str]:
    """Return in words what an agent says over and over in durable uses, taking nothing in between, though the model
    leaves it out: words that are silent, and those under `may`.
    """
    for row in _free_loops(machine):
        for said in dict.fromkeys((*(word for word in row.say if word in silent), *row.may)):
            use = machine.uses[said.use]
            if use.durable:
                states = "|".join(sorted(row.states))
                told = f"how many `{said}` of {machine.agent} wait for {use.peer}: in {states} on {row.event} it may be"
                yield f"{told} said over and over (row {row.number}); a full outbox holds {machine.agent} back"


def _free_loops(machine: Machine) -> Iterator[Row]:
    """Rows without a message from whose next state such rows lead back to a state of theirs."""
    free = [row for row in machine.rows if row.event.cause in (Cause.OWN, Cause.PERSON) and not row.several]
    leads = {state: {row.to or state for row in free if state in row.states} for state in machine.waits}
    for row in free:
        if any(state in _reached(row.to or state, leads) for state in row.states):
            yield row


def _reached(start: str, leads: dict[str, set[str]]) -> set[str]:
    """The states that free rows lead to from a state, itself included."""
    found, waiting = {start}, [start]
    while waiting:
        more = leads[waiting.pop()] - found
        found |= more
        waiting += more
    return found


def _heard(machine: Machine) -> set[Said]:
    """The messages an agent's tables let it take, in durable uses."""
    return {
        Said(use.name, row.performative, row.kind)
        for use in machine.uses.values()
        if use.durable
        for row in use.protocol.tables[use.role]
        if row.way is Way.RECEIVE
    }


def _is_silent(machine: Machine, said: Said, silent: set[Said]) -> bool:
    event = Event(Cause.TAKE, *said)
    rows = [row for row in machine.rows if row.event == event and not row.several]
    use = machine.uses[said.use]
    return (
        bool(rows)
        and all(_changes_nothing(row, silent) for row in rows)
        and _loops(use.protocol.tables[use.role], said, silent)
    )


def _changes_nothing(row: Row, silent: set[Said]) -> bool:
    stays = not row.to and not row.owes and not row.waits and not row.drop and not row.moves
    return stays and all(said in silent for said in row.say)


def _loops(table: Table, said: Said, silent: set[Said]) -> bool:
    """Every row of the table that takes it comes back to its state, over silent words that it owes."""
    rows = [row for row in table if row.way is RECEIVE and (row.performative, row.kind) == (said.act, said.kind)]
    return all(row.state == _settled(table, str(row.to), said.use, silent) for row in rows)


def _settled(table: Table, state: str, use: str, silent: set[Said]) -> str:
    """Return the state that the words owed in a state lead to, if all of them are silent."""
    seen = set()
    while state in table.urgent and state not in seen:
        seen.add(state)
        owed = table.allowed(state, SEND)
        if len(owed) != 1 or Said(use, owed[0].performative, owed[0].kind) not in silent:
            break
        state = str(owed[0].to)
    return state
