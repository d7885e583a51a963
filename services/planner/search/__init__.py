"""The search of pl: an HTN domain that gets every fact from km, and the geometry of its primitive tasks.

It runs in a child process of the agent, so that a cancel can end it at once, and sends it Ask, Found or NotFound. It
imports no simulator and knows only the objects that km tells it.
"""
