"""FIPA's interaction protocols as tables, one module for each family.

The names are those of the paper; FIPA's tokens (`fipa-contract-net`) are aliases. Tests explore every protocol
exhaustively in both roles (`exploration.py`). Independent of agents, languages and time.
"""

from fipa_codec.protocols.brokering import BROKERING, PROPAGATE, RECRUITING
from fipa_codec.protocols.cancelling import Pending, cancellable, mirrored
from fipa_codec.protocols.contract_net import CFP, ICFP, PROPOSE
from fipa_codec.protocols.query import QUERY
from fipa_codec.protocols.request import REQUEST, REQUEST_WHEN
from fipa_codec.protocols.states import State
from fipa_codec.protocols.subscribe import SUBSCRIBE
from fipa_codec.tables import Protocol, named, register

__all__ = [
    "BROKERING",
    "CFP",
    "FIPA",
    "ICFP",
    "PROPAGATE",
    "PROPOSE",
    "QUERY",
    "RECRUITING",
    "REQUEST",
    "REQUEST_WHEN",
    "SUBSCRIBE",
    "Pending",
    "Protocol",
    "State",
    "cancellable",
    "mirrored",
    "named",
    "register",
]

FIPA = (REQUEST, REQUEST_WHEN, QUERY, SUBSCRIBE, CFP, ICFP, PROPOSE, BROKERING, RECRUITING)
"""The interaction protocols of SC00026H to SC00036H without the auctions, which remained experimental."""
