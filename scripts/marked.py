"""What a script writes into a page of the docs, between two marks."""


def put(text: str, opening: str, closing: str, made: str) -> str:
    """Return the page's text with what was made between the marks. Raise ValueError where a mark is
    not there.
    """
    before, begun, rest = text.partition(opening)
    _, ended, after = rest.partition(closing)
    if not begun or not ended:
        raise ValueError(f"the page needs the lines {opening.strip()} and {closing.strip()}")
    return before + opening + made + closing + after
