"""ORDER: transports that people want, and what became of them (desk and dispatcher)."""

import msgspec
from fipa_codec.languages import Kind, Language


class Sentence(msgspec.Struct, frozen=True, tag=True, forbid_unknown_fields=True):
    """Something said in ORDER."""


class Carry(Sentence, frozen=True):
    """Carry a thing from one station to another."""

    item: str
    source: str
    target: str


class Assigned(Sentence, frozen=True):
    """This robot carries it, and expects to have delivered in so many seconds."""

    robot: str
    seconds: float


class Delivered(Sentence, frozen=True):
    """It is where it was wanted."""

    item: str


class NotDelivered(Sentence, frozen=True):
    """It is not, and why."""

    reason: str


class Watch(Sentence, frozen=True):
    """Tell me the figures now and whenever they change."""


class Figures(Sentence, frozen=True):
    """How many orders were delivered, and how many could not be."""

    delivered: int
    failed: int


Content = Carry | Delivered | NotDelivered | Assigned | Watch | Figures
LANGUAGE = Language(
    "ORDER", Content, kind=lambda content: Kind.PROGRESS if isinstance(content, Assigned) else Kind.PLAIN
)
