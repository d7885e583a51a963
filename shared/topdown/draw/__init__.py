"""Tables and figures of the design method's paper, drawn from any design: terminal text, SVG, one
HTML page.

`book.sections` gives the parts, `document.written` and `book.page` print them. Every layout is
computed here and is deterministic: the same design gives the same bytes. Must not know: a
particular system, files, terminals.
"""
