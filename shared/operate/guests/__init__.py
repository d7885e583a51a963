"""Programs that are guests of a design: what they are offered, and how what they ask is done.

`offers`, `errands` and `consent` are for any protocol by which such programs come in; `mcp_server`
is MCP, `a2a_server` is A2A.
"""
