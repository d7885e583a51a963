"""A person's consent to what a guest asks for: the question, and the proof that exactly this was
asked. It holds for one offer with these arguments, once, for some minutes.

Must not know: by which protocol programs come in.
"""

import hashlib
import hmac
import json
import secrets
import time
from collections.abc import Mapping
from typing import Any

from operate.guests.offers import Offer

AGREES = "agree"
FORM: dict[str, Any] = {
    "type": "object",
    "properties": {AGREES: {"type": "boolean", "title": "Let the robot do this?"}},
    "required": [AGREES],
}
"""What a person fills in, as JSON schema."""
NOT_AGREED = "the person did not agree; do not ask again unless they say so"
LONGEST_SHOWN = 80
"""Characters of an argument that a person is shown; estimate: a name has ten."""
ASKED_S = 300.0
"""A person's consent is waited for so long (estimate)."""
MOST_ASKED = 1000
"""Questions without an answer that are remembered (estimate)."""


class Consents:
    """The questions to people that are under way."""

    def __init__(self) -> None:
        self._key, self._asked = secrets.token_bytes(32), dict[str, float]()

    def asks(self, offer: Offer, arguments: dict[str, Any]) -> str:
        """Proof that a person was to be asked for this; it is good once."""
        number = secrets.token_hex(16)
        while len(self._asked) >= MOST_ASKED:  # the oldest question has no answer any more
            del self._asked[next(iter(self._asked))]
        self._asked[number] = time.monotonic() + ASKED_S
        return f"{number}.{self._mark(number, offer, arguments)}"

    def was_asked(self, proof: str, offer: Offer, arguments: dict[str, Any]) -> bool:
        """Whether the proof is of this, and still good. It is not, after that."""
        number, _, mark = proof.partition(".")
        until = self._asked.get(number, 0.0)
        fits = hmac.compare_digest(mark.encode(), self._mark(number, offer, arguments).encode())
        if not fits or time.monotonic() > until:
            return False
        del self._asked[number]
        return True

    def _mark(self, number: str, offer: Offer, arguments: dict[str, Any]) -> str:
        what = json.dumps([number, offer.name, arguments], sort_keys=True)
        return hmac.new(self._key, what.encode(), hashlib.sha256).hexdigest()


def agreed(form: Mapping[str, Any] | None) -> bool:
    """Whether a form was filled in so that the robot may move: by `true`, and nothing like it."""
    return (form or {}).get(AGREES) is True


def question(guest: str, offer: Offer, arguments: dict[str, Any]) -> str:
    """What a person is asked. Arguments are shown as JSON, so that they cannot pass for the
    question's own words.
    """
    shown = (f"{name} = {json.dumps(value)[:LONGEST_SHOWN]}" for name, value in arguments.items())
    return f"{guest} wants the robot to do: {offer.name} ({', '.join(shown)})"
