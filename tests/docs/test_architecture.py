"""docs/architecture.md shows the rooms as the code has them."""

import house


def test_the_picture_is_that_of_the_code() -> None:
    """After a change of the imports between rooms: scripts/figures."""
    text = house.PAGE.read_text(encoding="utf-8")
    assert text == house.page(text)


def test_every_room_of_the_code_is_in_the_picture() -> None:
    """A new room cannot be forgotten."""
    assert {room for edge in house.edges() for room in edge} == set(house.ROOMS)
