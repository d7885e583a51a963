"""FIPA's interaction protocols as tables, one module for each family; in two profiles.

Where the paper's agents do what the specification does, there is one protocol: its name is the paper's, FIPA's token
(`fipa-contract-net`) is an alias. Where they differ there are two: `request`, `query` and `subscribe` are the paper's,
`fipa-request`, `fipa-query` and `fipa-subscribe` those of the specifications. A conversation has the rules of the name
it is opened with. Tests explore every protocol exhaustively in both roles (`exploration.py`). Independent of agents,
languages and time.
"""

from enum import StrEnum

from fipa_codec.protocols.brokering import BROKERING, PROPAGATE, RECRUITING
from fipa_codec.protocols.cancelling import Pending, cancellable, mirrored
from fipa_codec.protocols.contract_net import CFP, ICFP, PROPOSE
from fipa_codec.protocols.query import FIPA_QUERY, QUERY
from fipa_codec.protocols.request import FIPA_REQUEST, REQUEST, REQUEST_WHEN
from fipa_codec.protocols.states import State
from fipa_codec.protocols.subscribe import FIPA_SUBSCRIBE, SUBSCRIBE
from fipa_codec.tables import Protocol, named, register

__all__ = [
    "BROKERING",
    "CFP",
    "FIPA",
    "FIPA_QUERY",
    "FIPA_REQUEST",
    "FIPA_SUBSCRIBE",
    "ICFP",
    "PAPER",
    "PROPAGATE",
    "PROPOSE",
    "PROTOCOLS",
    "QUERY",
    "RECRUITING",
    "REQUEST",
    "REQUEST_WHEN",
    "SUBSCRIBE",
    "Pending",
    "Profile",
    "Protocol",
    "State",
    "cancellable",
    "mirrored",
    "named",
    "register",
]

FIPA = (FIPA_REQUEST, REQUEST_WHEN, FIPA_QUERY, FIPA_SUBSCRIBE, CFP, ICFP, PROPOSE, BROKERING, RECRUITING)
"""The interaction protocols of SC00026H to SC00036H without the auctions, which remained experimental."""

PAPER = (REQUEST, REQUEST_WHEN, QUERY, SUBSCRIBE, CFP, ICFP, PROPOSE, BROKERING, RECRUITING)
"""The same, as the paper's agents have them."""

PROTOCOLS = tuple(dict.fromkeys((*FIPA, *PAPER)))
"""Those of both profiles, each once."""


class Profile(StrEnum):
    """Owner of the protocols that FIPA's tokens (`fipa-request`) mean in a text of another platform."""

    FIPA = "fipa"
    """Those of the specifications."""
    PAPER = "paper"
    """Those of the paper: `fipa-request` is read as `request`, and a query is answered with inform-ref."""
