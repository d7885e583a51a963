"""A design proven before it runs: models of its tables, and an engine that looks at every state of
a model.

`engine` explores any model; `stream` is layer 1 (one durable stream in micro-steps); `pairs` is
layer 2 (both roles of a protocol, copies and receipts explicit); `net` is the form from which the
model and its exports are made.
"""
