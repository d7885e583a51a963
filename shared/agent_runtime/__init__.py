"""Embodied agents in general (paper, section 3): pure core, journal, an in-memory bus, and the
shell that does the I/O.

How to write an agent (tests/agent_runtime/toy_agents.py is a whole one):

1. Memory: a frozen msgspec Struct with defaults. It is journalled whenever it changes; what a death
   may take goes into a field named `soft` (another frozen Struct, all defaults): questions under
   way, hypotheses, ids of queries.
2. A behaviour per state: `transition(memory, turn) -> memory`, called with `turn.event is None` on
   entry, then once per event: match on Received(content=...), Local(...), Late, Broken, Woken,
   PeerChanged, Settled, Started; return the memory as it was for what you do not know. Beside it
   `terminal(memory)`, `error(memory)` and `takes(memory, event)`: what is not taken waits in the
   inbox, in order and unreceipted.
3. Speak by the turn: `open` a conversation (reply_by_s -> Late, once), `say` in it, `observe` for a
   subscriber, `tell` the own devices, `wake` at a time. Streams, receipts, re-sending, asking again
   and the order record -> receipt -> send are the core's.
4. What a protocol owes at once (confirm, coordinate's Running) must be said in the step that took
   the message.
5. `Started(first=False)`: soft things are gone; ask, subscribe or search again. Durable
   conversations, wake-ups and the memory are there.
6. Build `Agent` from the design's table and `Wiring` from its channels (agent_runtime.core.binding
   binds by name).
7. Run it on `testing.memory_bus.MemoryBus` in tests, by `shell.run` in a process: the same core,
   the same bytes.

A peer's slips (out of sequence, content of no language) are answered not-understood and counted; a
conversation that ends so comes as Broken. Our own slips raise. A cancel for an ended conversation
is answered by the core.
"""
