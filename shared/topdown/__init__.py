"""The design method in general: a design file, what follows from it, and what can be proven and
judged by it.

Read in this order: elements (what a file holds), loading, decomposition, design; checks and
agreement (is it sound); machines, steps, silence (what agents do at which event);
proving (before it runs); judging (while it runs); tracing, differing, estimating (for its
designer); drawing; scaffold. No I/O but files; knows no system.
"""
