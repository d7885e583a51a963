"""FIPA in general: performatives, communicates and their bytes, content languages, protocols as tables, conversations.

Read in this order: performatives, communicate, languages, tables, protocols, conversation, interfaces, exploration.
No I/O, no clock, no agent of this system; msgspec and the standard library only.
"""
