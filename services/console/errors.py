"""What can go wrong for a person at the command line; each message says what to do.

ConsoleError
    NoRunError      there is no run to talk about
    HiError         a_hi does not answer, or says no
    FleetError      the fleet did not come up, or not go down
"""


class ConsoleError(Exception):
    """Base of them all; the command line prints it and exits with 1."""


class NoRunError(ConsoleError):
    """There is no run folder where it was looked for."""

    def __init__(self, where: str) -> None:
        self.where = where
        super().__init__(f"no run at {where}; start one with `roco up`, or name it with --run-dir")


class HiError(ConsoleError):
    """The human interface does not answer (status 0), or answered with another status than 200."""

    def __init__(self, status: int, reason: str) -> None:
        self.status = status
        self.reason = reason
        super().__init__(f"the human interface said no ({status}): {reason}" if status else reason)


class FleetError(ConsoleError):
    """The fleet is not as wanted; `processes`: who, and why, in words."""

    def __init__(self, what: str, processes: tuple[str, ...] = ()) -> None:
        self.what = what
        self.processes = processes
        super().__init__("\n  ".join([what, *processes]))
