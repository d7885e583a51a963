"""A check that walks through a table is one test: it fails once, with every row that is wrong in
its message.
"""

from collections.abc import Callable, Iterable
from typing import Any


def each_row(rows: Iterable[tuple[Any, ...]], check: Callable[..., None]) -> None:
    """Check each row; fail with those for which the check raises, and why."""
    wrong = []
    for row in rows:
        try:
            check(*row)
        except Exception as error:  # whatever a check raises
            wrong.append(
                f"{', '.join(str(part)[:300] for part in row)}: {type(error).__name__}: {error}"
            )
    assert not wrong, "\n".join(wrong)
