"""FIPA in general: performatives, communicates and their bytes, content languages, protocols as tables, conversations.

Read in this order: performatives, communicate, languages, tables, protocols, conversation, multicast, interfaces,
exploration; for contents as FIPA defines them expressions, acts, proxying.
No I/O, no clock, no agent of this system; msgspec and the standard library only.
"""
