"""A fleet in Rerun: robot, things, agents and traffic on one time line; live and from a recording.

`stage` (events, and what is drawn) -> `sheet` (columns for Rerun). `file` writes
run.rrd after a run; `feed` (in the monitor) and `__main__` (a process of its own) show a run
while it goes on.
"""
