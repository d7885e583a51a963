"""How people see a pour."""

from companion.rows import ShownRow
from companion.tasks.pour.done import Pour

ACTS = (ShownRow(Pour, "pour", "#be185d", "pours", "poured", ("source", "destination")),)
