"""Statements of a designer beside the design: its outcome, figures that stand in two places, counts of a run.

A design that is only transcribed (a paper, a report) contradicts itself here first: the checks put each statement
beside the others and beside what the steps and protocols give. Nothing here knows a particular system.
"""

import msgspec


class Stated(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Base of statements. `where`: the place the statement stands in, as people find it."""

    where: str


class StatedChannel(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A channel as the designer lists it at the end."""

    id: str
    between: tuple[str, str]


class Outcome(Stated, frozen=True):
    """The sets the method puts out, written down: agents, groups that stay groups, channels (paper, section 4)."""

    agents: tuple[str, ...] = ()
    groups: tuple[str, ...] = ()
    channels: tuple[StatedChannel, ...] = ()


class Statement(Stated, frozen=True):
    """One statement of a claim: exactly one of `says` (a figure, a word, or a set of words), `sum`, `product`, or
    bounds (`least`, `most`; either may be missing). `over`: what a product is divided by.
    """

    says: float | str | tuple[str, ...] | None = None
    sum: tuple[float, ...] = ()
    product: tuple[float, ...] = ()
    over: tuple[float, ...] = ()
    least: float | None = None
    most: float | None = None


class Claim(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """One thing that is stated in several places, which must agree; figures within the share `tolerance`."""

    name: str
    stated: tuple[Statement, ...]
    unit: str = ""
    tolerance: float = 0.0
    ruling: str = ""


class Tally(Stated, frozen=True):
    """Communicates counted in a run: [sender, receiver, how many]. A pair that is missing had none."""

    counts: tuple[tuple[str, str, int], ...]
