"""Errors of the runtime; blame is in the type (fipa_codec.errors has those of protocols).

RuntimeFault
  AgentTableError     the agent's table of states, arcs and behaviours does not hold together (found
                      when it is built)
  BehaviourError      a behaviour asked for something impossible: a bug of the agent, always raised
  JournalError        the journal cannot be used (held by another process, of another agent,
                      unreadable)
  StepLogError        a step log is damaged before its end
  KeysError           a folder of keys lacks something, or is of another system (secured.py)
  TooLongError        a message is longer than a router hands on; nothing was put (sessions.py)
  WorkerError         a child process cannot be started or spoken to
"""


class RuntimeFault(Exception):
    """Base of the runtime's own errors."""


class AgentTableError(RuntimeFault):
    """`agent`'s table is wrong at `where`; `hint` says what would be right."""

    def __init__(self, agent: str, where: str, hint: str) -> None:
        self.agent, self.where, self.hint = agent, where, hint
        super().__init__(f"agent {agent!r}: {where}; {hint}")


class BehaviourError(RuntimeFault):
    """`agent` in state `state` did something impossible; `hint` says what would be right."""

    def __init__(self, agent: str, state: str, what: str, hint: str) -> None:
        self.agent, self.state, self.what, self.hint = agent, state, what, hint
        super().__init__(f"agent {agent!r} in state {state!r}: {what}; {hint}")


class JournalError(RuntimeFault):
    """The journal at `path` cannot be used."""

    def __init__(self, path: object, what: str, hint: str) -> None:
        self.path, self.what, self.hint = path, what, hint
        super().__init__(f"journal {path}: {what}; {hint}")


class StepLogError(RuntimeFault):
    """The step log at `path` has a line that cannot be read; it begins at byte `at`."""

    def __init__(self, path: object, at: int, what: str) -> None:
        self.path, self.at, self.what = path, at, what
        hint = "the lines before it are whole; it is damaged, or of another version"
        super().__init__(f"step log {path}: the line at byte {at} cannot be read: {what}; {hint}")


class WorkerError(RuntimeFault):
    """The worker `entry` cannot do what was asked."""

    def __init__(self, entry: str, what: str, hint: str) -> None:
        self.entry, self.what, self.hint = entry, what, hint
        super().__init__(f"worker {entry!r}: {what}; {hint}")
