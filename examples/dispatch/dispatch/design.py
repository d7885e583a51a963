"""The design, read once from design.toml; whatever follows from it is asked of here."""

from pathlib import Path

from fipa_codec import protocols
from topdown.model.design import Design, load
from topdown.model.interfaces import interfaces

from dispatch.languages import LANGUAGES

__all__ = ["DESIGN", "INTERFACES", "LANGUAGES"]

DESIGN: Design = load(Path(__file__).with_name("design.toml"))
for _table in DESIGN.own_tables.values():
    protocols.register(_table)

INTERFACES = interfaces(DESIGN, LANGUAGES)
"""Queries of each use of a protocol, with Python's classes."""
