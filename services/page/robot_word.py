"""The operator's word to ta, as the page gives it: begin the act that waits. Put on ta's control key, the one that the
identity `page` may write. Blocks: for threads only.
"""

import secrets
import time

import msgspec

from agent_runtime.core.control import KIND, Command, SetParameter
from agent_runtime.io import sessions
from agent_runtime.io.options import Options
from agent_runtime.io.secured import client_tls
from agent_runtime.io.sessions import close, open_client
from companion.autonomy import STEP, Verb, Word
from companion.design import DESIGN, AgentName
from services.page.robot_eye import IDENTITY

ROUTER_S = 3.0
"""Longest wait for the router [s] (estimate: it answers in milliseconds)."""


class RobotWord:
    """Sender of the operator's word. What hi tells next shows whether ta took it; a repeated word does nothing."""

    def __init__(self, options: Options) -> None:
        self._options = options
        self._key = DESIGN.signal_key(KIND, system=options.system, owner=IDENTITY, peer=AgentName.TA)

    def go(self, at: str) -> bool:
        """Let the act at this path of the plan begin. Return whether the router took the word."""
        until = time.monotonic() + ROUTER_S
        tls = client_tls(self._options.keys, IDENTITY) if self._options.keys else None
        session = open_client(self._options.connect, lambda: time.monotonic() > until, tls=tls)
        if session is None:
            return False
        order = SetParameter(STEP, str(Word(Verb.GO, at)))
        sessions.put(session, self._key, msgspec.msgpack.encode(Command(f"page-{secrets.token_hex(8)}", order)))
        close(session)
        return True
