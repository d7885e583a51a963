"""Runs, and what is drawn of them."""

import pytest
from noted import Noted, afterwards, recorded
from synthetic import Run

from companion.tools.system import SYSTEM
from operate.recording import history
from operate.recording.records import Record, understood


@pytest.fixture(scope="session")
def records(pouring: Run) -> list[Record]:
    """The records of the synthetic run."""
    return [understood(sample, SYSTEM) for sample in pouring.samples]


@pytest.fixture(scope="session")
def past(records: list[Record]) -> history.History:
    """Its history."""
    return history.of_records(records, SYSTEM)


@pytest.fixture(scope="session")
def sheet(past: history.History) -> Noted:
    """It, drawn."""
    return afterwards(past)


@pytest.fixture(scope="session")
def true_past() -> history.History:
    """A recorded pour of the whole fleet."""
    return recorded()


@pytest.fixture(scope="session")
def true_sheet(true_past: history.History) -> Noted:
    """It, drawn."""
    return afterwards(true_past)
