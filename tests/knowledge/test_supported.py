"""Every kind of query that the design declares is answered by km's code, and no other (paper, section 5.6)."""

from companion.design import DESIGN
from services.knowledge.answers import ANSWERS, MAKERS
from topdown.check.agreement import check_supported
from topdown.model.findings import Kind

SUPPORTED = {f"WM.{kind.__name__}" for kind in (*ANSWERS, *MAKERS)}
SUBSCRIPTION = "WM.ObserveWorld"  # km asks this one of ta, nobody asks km


def test_km_answers_exactly_what_may_be_asked() -> None:
    """Neither a query without code nor code without a query."""
    assert SUBSCRIPTION not in SUPPORTED
    assert check_supported(DESIGN, "km", SUPPORTED) == ()


def test_a_kind_that_loses_its_code_is_found() -> None:
    """Each of them, one by one."""
    for kind in SUPPORTED:
        found = check_supported(DESIGN, "km", SUPPORTED - {kind})
        assert [(one.kind, kind in one.where) for one in found] == [(Kind.NOT_SUPPORTED, True)]
