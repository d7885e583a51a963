"""The search of a_pl: an HTN domain whose every fact is asked of km, and the geometry behind its primitive tasks.

It runs in a child process of the agent (so that a cancel can end it at once) and talks to it in three words: Ask, Plan,
NoPlan. It imports no simulator and knows no object that km has not told it.
"""
