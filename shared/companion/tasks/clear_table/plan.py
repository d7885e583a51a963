"""Planning to clear the table: one thing after the other is put into the cabinet, as far as that is
possible.
"""

from companion.languages.facts import Kind, fact
from companion.planning.methods import Known, Subtasks
from companion.planning.registry import Plan

TABLE, CABINET = "table", "cabinet"  # classes of the ontology, in small letters as in a task


def clear_nothing(known: Known, state: str) -> Subtasks | None:
    """Do nothing where no thing that can be taken stands on a table, and say so."""
    if _on_tables(known, state):
        return known.unfit(fact(Kind.SOMETHING_ON_A_TABLE))
    return [("a_tell", fact(Kind.NOTHING_ON_A_TABLE))]


def clear_things(known: Known, state: str) -> Subtasks | None:
    """Put one thing after the other into the cabinet, as far as that is possible."""
    names = _on_tables(known, state)
    if not names:
        return known.unfit(fact(Kind.NOTHING_ON_A_TABLE))
    return [*(("clear_away", name) for name in names), ("a_some_done",)]


def clear_into_cabinet(known: Known, state: str, name: str) -> Subtasks | None:
    """Put it into the cabinet."""
    return [("put_at", name, CABINET)]


def clear_not(known: Known, state: str, name: str) -> Subtasks | None:
    """Leave it, and tell the reason that was noted last."""
    return [("a_tell", fact(Kind.STAYS, name, known.why[-1]))]


def _on_tables(known: Known, state: str) -> list[str]:
    tables = known.facts.places(state, TABLE)
    return [
        name for name in known.facts.moveable(state) if known.facts.support(state, name) in tables
    ]


PLAN = Plan(
    tasks={"clear_table": ()},
    methods={
        "clear_table": (clear_nothing, clear_things),
        "clear_away": (clear_into_cabinet, clear_not),
    },
)
