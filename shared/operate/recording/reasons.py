"""Reasons of a run: of one of its tasks, or of what is believed of a thing, where its system knows
of things.
"""

from operate.recording.run import Run
from operate.structs import NothingToRead
from operate.system import System
from operate.tracing.reasons import Why, absent, content_text, ending
from operate.tracing.trace import Span, Trace

WATCH = "subscribe"


class NothingKnown(NothingToRead):
    """Nothing is recorded of what was asked about; it says what may be asked."""


def of(run: Run, about: str, at: float | None = None) -> Why:
    """Return the reasons. `at`: beliefs as they were then [s after the first communicate]. Raise
    NothingKnown.
    """
    system = run.system
    tasks = people(run.trace, system)
    span = run.trace.named(about) if about else tasks[-1] if tasks else None
    if span is not None:
        return _of_task(run, span)
    if about and (believed := system.addition("believed")) is not None:
        found: Why | None = believed(run, about, at)
        if found is not None:
            return found
    known = ", ".join(one.id for one in tasks[-8:]) or "none"
    if about:
        thing = ", nor a thing that the system knew" if system.additions.believed else ""
        raise NothingKnown(f"{about!r} is no task of this run{thing}; its tasks are {known}")
    raise NothingKnown(
        f"no task was asked for in {run.place}; give the folder of a run in which one was"
    )


def people(trace: Trace, system: System) -> tuple[Span, ...]:
    """Return what was asked for from outside, oldest first: the conversations opened by agents that
    nobody asks.
    """
    asked = {use.participant for use in system.design.file.protocol}
    return tuple(one for one in trace.roots if one.initiator not in asked and one.protocol != WATCH)


def _of_task(run: Run, span: Span) -> Why:
    more = run.system.addition("why")
    own = [] if more is None else more(run, span)
    passages = [ending(run.trace, span), *own, absent(run.trace, span)]
    what, took, last = span.text or span.protocol, span.end - span.start, span.last
    content = f": {content_text(last)}" if content_text(last) else ""
    ended = f"ended after {took:.1f} s with {last.performative}{content}"
    text = f"{what}: {ended if span.ended else f'open for {took:.1f} s'}"
    found = tuple(one for one in passages if one is not None and one.facts)
    return Why(span.id, text, run.trace.begin, found)
