"""A project made from a design file: packages, typed interfaces, stubs to fill in, tests,
processes, compose entries.

`scaffold(design_text, name, folder)` writes it and tells what it wrote, kept and left alone. What
is made runs at once: behaviours that are not filled in refuse what they are asked
(agent_runtime.core.agent). The text of the project imports agent_runtime, fipa_codec, topdown and
operate; this package itself imports only fipa_codec.
"""

from topdown.scaffold.project import Outcome, ScaffoldError, project_files, scaffold, smallest

__all__ = ["Outcome", "ScaffoldError", "project_files", "scaffold", "smallest"]
