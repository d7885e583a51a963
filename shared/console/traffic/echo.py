"""`roco traffic echo`: one line for each communicate, as it is judged, live and of a recording."""

import sys
import time
from collections.abc import Iterable, Iterator
from contextlib import suppress
from datetime import datetime
from typing import Any

import msgspec
from rich.cells import cell_len, set_cell_size
from rich.text import Text

from agent_runtime.core.wiring import parse_life
from agent_runtime.io.tap import Sample
from console.fleet import targets
from console.output import Form, Format, RunDir, problems, tell_json
from console.terminal.console import Console
from console.traffic import selection
from console.traffic.listen import Source, about, heard_message, source
from fipa_codec.communicate import Communicate, decode
from operate.filters import Filter
from operate.system import System
from operate.verdict_lines import Judged, line
from operate.wording import bytes_in_words
from topdown.judge.judge import Judge
from topdown.judge.verdicts import Judgement, Verdict

ENDLESS = 10_000
"""Columns where nobody's terminal is: a line for each, whole."""
STYLES = {Verdict.LEGAL: "green", Verdict.SLOW: "yellow"}
Echoed = tuple[Judged, Communicate | None]


def echo(
    channel: selection.Channels = None,
    agent: selection.Agents = None,
    protocol: selection.Protocols = None,
    performative: selection.Performatives = None,
    wrong: selection.Wrong = False,
    run: selection.Recorded = None,
    count: selection.Count = 0,
    for_: selection.Seconds = 0.0,
    target: targets.Name = "",
    run_dir: RunDir = None,
    form: Form = Format.TEXT,
) -> None:
    """Print a line for each communicate: time, channel, who to whom, act, protocol, size, content,
    verdict.

    Of a running fleet until Ctrl-C. A verdict that has to wait for what explains it comes up to
    three seconds later; of a conversation that had begun before nothing can be judged. JSON has all
    fields and the whole content, an object a line.

    Examples:
      roco traffic echo
      roco traffic echo --channel CHANNEL --agent AGENT --count 10
      roco traffic echo --target compose --wrong
      roco traffic echo --run runs/latest --performative request --format json
    """
    with problems(form):
        which = selection.wanted(
            about(run, run_dir, target).design, channel, agent, protocol, performative
        )
        with source(run, run_dir, target) as heard:
            _print(heard, which, form, count=count, seconds=for_, wrong=wrong)


def _print(
    heard: Source, which: Filter, form: Form, *, count: int, seconds: float, wrong: bool
) -> None:
    console = Console(highlight=False)
    width = console.width if console.is_terminal else ENDLESS
    names = _widest(heard.system)
    with suppress(KeyboardInterrupt):
        for one, communicate in chosen(heard, which, count=count, seconds=seconds, wrong=wrong):
            if form is Format.JSON:
                tell_json(fields(one, communicate))
            else:
                console.print(drawn(one, width, names), soft_wrap=True)
    tell_lost(heard)


def chosen(
    heard: Source, which: Filter, *, count: int, seconds: float, wrong: bool
) -> Iterator[Echoed]:
    """Yield what is meant of what is said, as it is judged: `count` of it at most, 0: all; `wrong`:
    violations only.
    """
    found = 0
    for one, communicate in echoed(heard, seconds):
        if which.keeps(one) and (one.violation or not wrong):
            yield one, communicate
            found += 1
            if found == count:
                return


def tell_lost(heard: Source) -> None:
    """Say on standard error how many came faster than they could be taken, if any did."""
    if lost := heard.lost():
        print(f"roco: {lost.removeprefix('; ')}", file=sys.stderr)


def echoed(heard: Source, seconds: float = 0.0) -> Iterator[Echoed]:
    """Yield each communicate with the judge's verdict; those that wait for their verdict come
    later.
    """
    system, last = heard.system, 0.0
    judge = Judge(system.design, system.languages)
    for sample in heard.samples(seconds):
        last = time.time() if sample is None else sample.at
        yield from (_line(found, system) for found in _judged(judge, sample, last))
    yield from (_line(found, system) for found in judge.finish(last))


def _judged(judge: Judge, sample: Sample | None, at: float) -> Iterable[Judgement]:
    if sample is None:
        return judge.pass_time(at)
    if sample.token:
        agent, chunk = sample.key.split("/")[-2:]
        found = None if sample.gone else parse_life(chunk)
        return judge.lived(agent, found[0], at, journal=found[1]) if found is not None else ()
    if heard_message(sample) is None:
        return judge.pass_time(at)
    if sample.broken:
        return judge.noted(sample.key, sample.broken, at)
    if sample.size:
        return judge.hear(sample.key, decode(sample.data), at, sample.size, (None, None))
    return judge.hear(sample.key, sample.data, at)


def _line(judgement: Judgement, system: System) -> Echoed:
    return line(judgement, system), judgement.heard.communicate


def _widest(system: System) -> int:
    """Columns of the longest "sender>receiver" of a design."""
    channels = system.design.channels.values()
    return max((len(">".join(channel.ends)) for channel in channels), default=0)


def fields(one: Judged, communicate: Communicate | None) -> dict[str, Any]:
    """The line for programs: the verdict's and the communicate's fields, absent where they are
    empty.
    """
    told = msgspec.to_builtins(one)
    if communicate is not None:
        for name in ("ontology", "reply_by", "reply_with", "in_reply_to", "sent"):
            told[name] = getattr(communicate, name)
        if communicate.content is not msgspec.UNSET:
            told["content"] = msgspec.msgpack.decode(communicate.content)
    return {name: value for name, value in told.items() if value not in ("", None)}


def drawn(one: Judged, width: int, names: int) -> Text:
    """The line for people, no wider than `width` but for the reason of a violation, which stands
    below.

    `names`: columns of who speaks to whom.
    """
    style = "bold red" if one.violation else STYLES.get(Verdict(one.verdict), "dim")
    clock = datetime.fromtimestamp(one.t).strftime("%H:%M:%S.%f")[:-3]
    who = f"{one.sender}>{one.receiver}" if one.sender else "?"
    text = Text(no_wrap=True)
    text.append(f"{clock} ", "dim").append(f"{one.channel:2} ").append(f"{who:{names}} ", "bold")
    text.append(f"{one.performative:11} ", "cyan").append(f"{one.protocol:10} ", "dim")
    text.append(f"{bytes_in_words(one.bytes):>7}  ")
    room = width - cell_len(text.plain) - len(one.verdict) - 1
    words = one.text or one.key
    if width == ENDLESS:
        words = f"{words:34}"
    else:
        words = words if cell_len(words) <= room else words[: max(0, room - 1)] + "…"
        words = set_cell_size(words, max(0, room))
    text.append(words, "italic").append(f" {one.verdict}", style)
    if one.violation and one.why:
        text.append(f"\n{'':13}{one.why}", "red")
    return text
