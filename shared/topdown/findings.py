"""What a check finds: the kind of inconsistency, where it is, what is wrong, what would be right."""

from enum import StrEnum

import msgspec


class Kind(StrEnum):
    """What a finding is about."""

    TWICE = "defined twice"
    REQUIREMENT = "requirement"
    DECOMPOSITION = "decomposition"
    CHANNEL = "channel"
    PROTOCOL = "protocol"
    LANGUAGE = "language"
    INTERFACE = "interface"
    STATE = "state machine"


class Finding(msgspec.Struct, frozen=True):
    """Something inconsistent."""

    kind: Kind
    where: str
    wrong: str
    right: str

    def __str__(self) -> str:
        return f"{self.where}: {self.wrong}; {self.right}"
