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


class PaperEvent(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One of its events, by our name: `t` s from the start of its run."""

    event: str
    t: float
    of: tuple[str, ...] = ()

    @property
    def id(self) -> str:
        """Its name with what it is of."""
        return " ".join((self.event, *self.of))


class Paper(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Its run. `matrix`: sender -> receiver -> count."""

    source: str
    total_table: int
    small: float
    largest_bytes: int
    c4_least_bytes: int
    c4_mean_bytes: int
    c4_largest_bytes: int
    time: tuple[PaperEvent, ...]
    matrix: dict[str, dict[str, int]]
    plan: tuple[PaperPlan, ...]

    @property
    def times(self) -> dict[str, float]:
        """Our id of an event -> seconds from the start."""
        return {one.id: one.t for one in self.time}

    def made(self, number: int) -> PaperPlan | None:
        """The plan of this number."""
        return next((plan for plan in self.plan if plan.number == number), None)


PAPER = msgspec.toml.decode(Path(__file__).with_name("paper.toml").read_bytes(), type=Paper)
TABLE_8 = ("co", "hi", "km", "pl", "ta", "ex")
"""The agents in the order of the paper's Table 8."""
