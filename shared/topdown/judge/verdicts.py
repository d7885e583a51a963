"""Verdicts of a judge about a communicate, and the rules for one communicate by itself.

The words are those of reports, logs and exit codes. Nothing here knows a particular system, a clock
or a wire.
"""

import re
from enum import StrEnum
from functools import lru_cache
from typing import Any, NamedTuple

import msgspec

from fipa_codec.communicate import Communicate
from fipa_codec.errors import FipaError
from fipa_codec.languages import REASON, Kind, Languages
from fipa_codec.performatives import Performative
from topdown.model.design import REASON as REASON_CLASS
from topdown.model.design import Design, Rule


class Verdict(StrEnum):
    """One verdict; those of VIOLATIONS are against the design."""

    LEGAL = "legal"
    COPY = "copy"
    """Said before, word for word: a durable communicate sent again, a question asked again."""
    SLOW = "slow"
    """In sequence and before reply-by, but later than the design says an answer should need at
    most.
    """
    NOT_JUDGED = "not judged"
    """Of a conversation whose beginning, or a part of it, was not heard: its place in the sequence
    is not known.
    """
    OUT_OF_SEQUENCE = "out of sequence"
    WRONG_CHANNEL = "wrong channel"
    """On a key that says something else than the communicate, or on another channel than the design
    has it on.
    """
    WRONG_LANGUAGE = "wrong language"
    """Language, ontology or class of content are not those of the design, or the content cannot be
    read.
    """
    OVER_BUDGET = "over budget"
    """Larger than the design allows."""
    LATE = "late"
    """An answer after reply-by."""
    UNANSWERED = "unanswered"
    """Reply-by passed, and no answer was heard."""
    NOT_ENTITLED = "not entitled"
    """An agent that the design does not know, or one that may not say this act in this protocol to
    that receiver.
    """
    MALFORMED = "malformed"
    """Bytes that are not a communicate."""
    NOT_TAKEN = "not taken"
    """Said, and nobody took it: its receiver was down, frozen or out of reach."""
    NOT_SAID = "not said"
    """Taken, and its sender did not say it: somebody else did, in its name."""
    ALTERED = "altered"
    """Its receiver took other words than its sender said."""


FINE = frozenset({Verdict.LEGAL, Verdict.COPY, Verdict.SLOW, Verdict.NOT_JUDGED, Verdict.NOT_TAKEN})
VIOLATIONS = frozenset(Verdict) - FINE


class Heard(msgspec.Struct, frozen=True, gc=False):
    """The `n`-th sample (from 1), heard at `at` [s] on `key`; `size` [bytes]; None: not a
    communicate.
    """

    n: int
    at: float
    key: str
    size: int
    communicate: Communicate | None


class Judgement(msgspec.Struct, frozen=True):
    """A verdict about one communicate, and why.

    `channel`: the one the design has it on, else what its key says. `states`: initiator and
    participant after it, if nothing is lost on its way; several with | between where that is not
    certain; "" where it is not followed.
    """

    verdict: Verdict
    heard: Heard
    channel: str = ""
    why: str = ""
    states: tuple[str, str] = ("", "")

    @property
    def violation(self) -> bool:
        """Whether it is against the design."""
        return self.verdict in VIOLATIONS


# --- Rules of a design for one communicate by itself: sender, receiver, key, language and size
# Rules, languages and the key's template are those of the design file, by which the agents run.
# Nothing here knows what was said before.


KEYS = 4096
"""Keys, and combinations of words that are right, that are remembered; estimate: a design has some
hundred.
"""
UNKNOWN_KINDS = (Kind.PLAIN, Kind.PROGRESS, Kind.FINAL)
"""Kinds an inform may have whose content cannot be read."""


Read = tuple[str | None, Kind | None]
"""LANGUAGE.Class ("" for none) and kind of a content that was read before; None where it is not
known.
"""


class Fault(NamedTuple):
    """A fault, and why."""

    verdict: Verdict
    why: str


class Admitted(NamedTuple):
    """`rule` None: the design has no such message. `kinds`: uses of the performative by its
    content.
    """

    rule: Rule | None
    channel: str
    kinds: tuple[Kind, ...]
    faults: tuple[Fault, ...]


class Admission:
    """Judges by the rules of a design; `languages` None: contents are not read, and only named
    languages are judged.
    """

    def __init__(self, design: Design, languages: Languages | None) -> None:
        self._rules, self._agents = design.rules, frozenset(design.agents)
        self._languages = languages
        self._fine: dict[tuple[object, ...], tuple[Rule, int]] = {}
        template = re.escape(design.file.system.key).replace(r"\{", "{").replace(r"\}", "}")
        pattern = re.compile(re.sub(r"\{(\w+)\}", r"(?P<\1>[^/]+)", template))

        @lru_cache(KEYS)
        def parts(key: str) -> dict[str, str] | None:
            match = pattern.fullmatch(key)
            return None if match is None else match.groupdict()

        self.parts = parts

    def check(self, key: str, one: Communicate, size: int, read: Read | None = None) -> Admitted:
        """`read`: what the content is, where it is not there."""
        name, kind, unread = self._read(one) if read is None else (*read, None)
        words = (
            key,
            one.sender,
            one.receiver,
            one.protocol,
            one.performative,
            one.language,
            one.ontology,
            name,
        )
        known = self._fine.get(words)
        if known is not None and unread is None and kind is not None and not 0 < known[1] < size:
            return Admitted(known[0], known[0].channel, (kind,), ())
        rule = self._rules.get((one.sender, one.receiver, one.protocol, one.performative))
        if rule is None:
            fault = Fault(Verdict.NOT_ENTITLED, self._no_rule(one))
            return Admitted(None, self.channel(key), (), (fault,))
        faults = []
        if wrong := self._wrong_key(key, one, rule):
            faults.append(Fault(Verdict.WRONG_CHANNEL, wrong))
        if wrong := unread or self._wrong_words(one, rule, name):
            faults.append(Fault(Verdict.WRONG_LANGUAGE, wrong))
            kind = None
        most = rule.sizes.get(name or "", rule.bytes)
        if not faults and len(self._fine) < KEYS:
            self._fine[words] = (rule, most)
        if size > most > 0:
            what = f" with {name}" if name else ""
            why = f"{size} B; the design allows {one.performative}{what} {most} B"
            faults.append(Fault(Verdict.OVER_BUDGET, why))
        channel = rule.channel
        return Admitted(rule, channel, UNKNOWN_KINDS if kind is None else (kind,), tuple(faults))

    def channel(self, key: str) -> str:
        """The channel that a key names, "" if none."""
        return (self.parts(key) or {}).get("channel", "")

    def _no_rule(self, one: Communicate) -> str:
        for agent in (one.sender, one.receiver):
            if agent not in self._agents:
                return (
                    f"the design has no agent {agent!r}; it has {', '.join(sorted(self._agents))}"
                )
        acts = sorted(
            p for s, r, i, p in self._rules if (s, r, i) == (one.sender, one.receiver, one.protocol)
        )
        if acts:
            may = ", ".join(acts)
            return (
                f"{one.sender} may not say {one.performative} to {one.receiver} in {one.protocol};"
                f" allowed: {may}"
            )
        spoken = sorted({i for s, r, i, _ in self._rules if (s, r) == (one.sender, one.receiver)})
        if spoken:
            return (
                f"{one.sender} and {one.receiver} do not talk by {one.protocol!r}; they do by"
                f" {', '.join(spoken)}"
            )
        peers = sorted({r for s, r, _, _ in self._rules if s == one.sender})
        return (
            f"no channel joins {one.sender} and {one.receiver}; {one.sender} may talk to"
            f" {', '.join(peers)}"
        )

    def _wrong_key(self, key: str, one: Communicate, rule: Rule) -> str | None:
        parts = self.parts(key)
        if parts is None:
            return f"the key {key!r} is none of a communicate"
        told = {
            "sender": one.sender,
            "receiver": one.receiver,
            "protocol": one.protocol,
            "performative": one.performative.value,
        }
        for name, word in told.items():
            if parts.get(name, word) != word:
                return f"its key says {name} {parts[name]!r}, the communicate {word!r}"
        if parts.get("channel", rule.channel) != rule.channel:
            return f"it is on {parts['channel']}; the design has it on {rule.channel}"
        return None

    def _read(self, one: Communicate) -> tuple[str | None, Kind | None, str | None]:
        """LANGUAGE.Class of the content ("" for none, None for not known), its kind, and what is
        wrong with it.
        """
        if one.content is msgspec.UNSET:
            return "", Kind.PLAIN, None
        if self._languages is None:
            return None, None, None
        try:
            content, kind = self._languages.read(one)
        except FipaError as error:
            return None, None, str(error)
        return f"{one.language}.{type(content).__name__}", kind, None

    def _wrong_words(self, one: Communicate, rule: Rule, name: str | None) -> str | None:
        reason = one.language == REASON.name and REASON_CLASS in rule.contents
        if one.language != rule.language and not reason:
            return (
                f"language {one.language or 'none'!r}; the design has {rule.language or 'none'!r}"
                " here"
            )
        if one.ontology != rule.ontology and not reason:
            return (
                f"ontology {one.ontology or 'none'!r}; the design has {rule.ontology or 'none'!r}"
                " here"
            )
        wanted = [c for c in rule.contents if c != REASON_CLASS]
        if name == "" and wanted and one.performative is not Performative.NOT_UNDERSTOOD:
            return f"no content; {one.performative} carries {_some(wanted)}"
        if name and name not in rule.contents:
            return f"content {name}; {one.performative} carries {_some(rule.contents)}"
        return None


def _some(names: Any) -> str:
    shown = list(names)
    more = f" and {len(shown) - 4} more" if len(shown) > 4 else ""
    return (", ".join(shown[:4]) or "nothing") + more
