"""How people see that something is handed over."""

from companion.rows import ShownRow
from companion.tasks.hand_over.done import HandOver

ACTS = (
    ShownRow(HandOver, "hand over", "#0f766e", "hands something over", "handed-over", ("object",)),
)
