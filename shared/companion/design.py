"""The design of the Robot Companion, read once from design.toml; every agent, tool and document
gets it here.

`DESIGN.key(system, communicate)`, `DESIGN.rule(communicate)`, `DESIGN.agent("co")` ... are in
topdown.model.design. Must not know: agents' code, Zenoh.
"""

from enum import StrEnum
from pathlib import Path

from companion.all_languages import LANGUAGES
from fipa_codec import protocols
from fipa_codec.interfaces import ClassInterfaceInfo
from fipa_codec.languages import REASON, Language
from topdown.model.design import Design, load
from topdown.model.interfaces import interfaces

FILE = Path(__file__).with_name("design.toml")
DESIGN: Design = load(FILE)
COORDINATE = protocols.register(DESIGN.own_tables["coordinate"])
"""The paper's own protocol, known by name from here on (paper, section 5.4)."""


class AgentName(StrEnum):
    """The six agents by the names of the paper."""

    CO = "co"
    HI = "hi"
    PL = "pl"
    KM = "km"
    TA = "ta"
    EX = "ex"


# The languages of the design (and the one of reasons, which everybody reads): class of a content ->
# its language.
_SPOKEN: dict[type, Language] = {
    kind: language
    for language in (REASON, *(LANGUAGES.named(entry.name) for entry in DESIGN.file.language))
    for kind in language.classes
}


def language_of(content: object) -> Language:
    """The language a content is written in. Raises KeyError for what belongs to none."""
    return _SPOKEN[type(content)]


# What can be asked in each use of a protocol, in the paper's form (section 5.6).
INTERFACES: dict[str, ClassInterfaceInfo] = interfaces(DESIGN, LANGUAGES)
