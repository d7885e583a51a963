"""docs/architecture.md shows the rooms, and who writes an agent's state, as the code has them."""

import house
import writers


def test_the_picture_is_that_of_the_code() -> None:
    """After a change of the imports between rooms: scripts/figures."""
    text = house.PAGE.read_text(encoding="utf-8")
    assert text == house.page(text)


def test_every_room_of_the_code_is_in_the_picture() -> None:
    """A new room cannot be forgotten."""
    assert {room for edge in house.edges() for room in edge} == set(house.ROOMS)


def test_the_table_of_writers_is_that_of_the_code() -> None:
    """After a change of agent_runtime.core: scripts/figures."""
    text = writers.PAGE.read_text(encoding="utf-8")
    assert text == writers.page(text)


def test_every_field_has_a_writer_but_the_name_of_the_agent() -> None:
    """A way to write a field that the script does not know leaves that field without one."""
    assert {field for field, by in writers.writers().items() if not by} == {"agent"}
