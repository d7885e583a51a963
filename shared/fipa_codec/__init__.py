"""FIPA messages, their content languages, interaction protocols as tables, and conversations.

The names below are what most programs need. Further modules, each a part of the public interface:

- `acl_string`: FIPA ACL messages as text (SC00070I), to and from communicates
- `envelope`: what platforms post to each other, envelope and message (SC00084, SC00085)
- `protocols`: FIPA's interaction protocols and their states, by constant
- `tables`: protocols of your own; `exploration`: exhaustive check of a protocol's two roles
- `acts`, `expressions`, `proxying`: contents as FIPA defines them, brokering and recruiting

No I/O, no clock, no agent of a particular system. Requires msgspec and the standard library only.
"""

from fipa_codec.communicate import Communicate, decode, decode_strictly, encode, encode_strictly
from fipa_codec.conversation import Conversation
from fipa_codec.errors import (
    ContentError,
    FipaError,
    LocalProtocolError,
    MalformedError,
    RemoteProtocolError,
)
from fipa_codec.interfaces import ClassInterfaceInfo
from fipa_codec.languages import REASON, Kind, Language, Languages, Reason
from fipa_codec.multicast import Multicast
from fipa_codec.performatives import Performative
from fipa_codec.protocols import FIPA, State, named, register
from fipa_codec.tables import NOT_UNDERSTOOD, START, Protocol, Role, Row, Table, Way

__all__ = [
    "FIPA",
    "NOT_UNDERSTOOD",
    "REASON",
    "START",
    "ClassInterfaceInfo",
    "Communicate",
    "ContentError",
    "Conversation",
    "FipaError",
    "Kind",
    "Language",
    "Languages",
    "LocalProtocolError",
    "MalformedError",
    "Multicast",
    "Performative",
    "Protocol",
    "Reason",
    "RemoteProtocolError",
    "Role",
    "Row",
    "State",
    "Table",
    "Way",
    "decode",
    "decode_strictly",
    "encode",
    "encode_strictly",
    "named",
    "register",
]
