"""How people see that a leaf is opened."""

from companion.rows import ShownRow
from companion.tasks.open_door.done import OpenDoor

ACTS = (
    ShownRow(OpenDoor, "open", "#78350f", "opens a door", "opened", ("door",), points_on="door"),
)
