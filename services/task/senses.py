"""Facts of faulty sensors."""

from companion.languages import rc
from companion.languages.facts import Facts, Kind, fact


def told(outcome: rc.Done | rc.NotDone) -> Facts:
    """Return which sensors are faulty, and how."""
    return tuple(fact(Kind.ILL, one.sense, one.fault, one.off) for one in outcome.ill)
