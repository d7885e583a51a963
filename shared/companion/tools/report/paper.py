"""The paper's figures, read from paper.toml, where their source stands."""

from pathlib import Path

import msgspec


class PaperPlan(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The making of a plan in the paper; None: not stated."""

    number: int
    wall_s: float
    communicates: int
    mean_kbit_s: float | None = None
    peak_kbit_s: float | None = None


class Paper(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Its run. `times`: our name of an event -> seconds from the start; `matrix`: sender -> receiver -> count."""

    source: str
    total_table: int
    small: float
    largest_bytes: int
    c4_least_bytes: int
    c4_mean_bytes: int
    c4_largest_bytes: int
    times: dict[str, float]
    matrix: dict[str, dict[str, int]]
    plan: tuple[PaperPlan, ...]

    def made(self, number: int) -> PaperPlan | None:
        """The plan of this number."""
        return next((plan for plan in self.plan if plan.number == number), None)


PAPER = msgspec.toml.decode(Path(__file__).with_name("paper.toml").read_bytes(), type=Paper)
TABLE_8 = ("co", "hi", "km", "pl", "ta", "ex")
"""The agents in the order of the paper's Table 8."""
