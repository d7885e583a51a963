"""The planner's toolkit: an HTN search that gets every fact from km, and the geometry that steps of
several tasks need.

It knows no task: methods and steps of each are in companion/tasks/<task>/plan.py, one row each
(registry.Plan). The search runs in a child process of pl, so that a cancel can end it at once. It
imports no simulator and knows only the objects that km tells it.
"""
