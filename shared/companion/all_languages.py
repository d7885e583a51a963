"""The six content languages of the Robot Companion by name (paper, section 5.6), with the contents
that tasks add.
"""

from typing import TYPE_CHECKING, Union

from companion import acts, commands
from companion.languages import cmd, hfsm, rs, sw, wm
from fipa_codec.languages import Kind, Language, Languages

if TYPE_CHECKING:
    AnyCommand = cmd.Command
else:
    AnyCommand = Union[tuple(row.content for row in commands.rows())]  # noqa: UP007
"""A command of some task, for the bytes: Command itself is no content."""


def _kind_of_report(content: object) -> Kind:
    """In coordinate an inform is one on the way or the last one; the worker's state tells which."""
    final = isinstance(content, sw.Report) and content.state in sw.FINAL
    return Kind.FINAL if final else Kind.PROGRESS


def _kind_of_task(content: object) -> Kind:
    """In request an inform tells progress or the result; the task's state tells which."""
    begun = (cmd.TaskState.WAITING, cmd.TaskState.PLANNING)
    going_on = (*begun, cmd.TaskState.RUNNING, cmd.TaskState.SUSPENDED)
    progress = isinstance(content, cmd.TaskReport) and content.state in going_on
    return Kind.PROGRESS if progress else Kind.PLAIN


HFSM = Language("HFSM", hfsm.Content)
SW = Language("SW", sw.Content, kind=_kind_of_report)
WM = Language("WM", wm.Content)
CMD = Language("CMD", AnyCommand | cmd.TaskReport, kind=_kind_of_task)
RC = Language("RC", acts.Content)
RS = Language("RS", rs.Content)

LANGUAGES = Languages((HFSM, SW, WM, CMD, RC, RS))
