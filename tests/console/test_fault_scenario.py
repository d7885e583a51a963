"""Scenarios of faults: a seed chooses, always the same, within what the file says; what is wrong is
named.
"""

import inspect
import shlex
import tempfile
from pathlib import Path
from typing import Any

import msgspec
import pytest
from calling import printed
from hypothesis import given
from hypothesis import strategies as st

from console import lazy
from console.errors import UsageError
from console.faults import verbs
from console.faults.kinds import AMOUNTS, KINDS, UNTIMED, VERBS
from console.faults.verbs import EVERY_S, SIGNED, Entry, Scenario, choose, fault_arguments, load

numbers = st.floats(0, 100).map(lambda value: round(value, 3))
spans = numbers | st.tuples(numbers, numbers).map(lambda pair: (min(pair), max(pair)))
names = st.sampled_from(["mule", "ox", "desk"])


def amounts(kind: str) -> st.SearchStrategy[Any]:
    """Return a strategy for the amounts of a kind, required and optional."""
    below = spans.map(
        lambda span: tuple(-one for one in reversed(span)) if isinstance(span, tuple) else -span
    )
    return spans | below if kind in SIGNED else spans if kind in AMOUNTS else st.none() | spans


@st.composite
def entries(draw: st.DrawFn) -> Entry:
    """Any entry that is right."""
    kind = draw(st.sampled_from(VERBS))
    repeated = draw(st.booleans())
    return Entry(
        kind,
        draw(names | st.lists(names, min_size=1, max_size=3).map(tuple)),
        draw(spans | st.sampled_from(["", "ox:idle", "3rd-message"])),
        None if kind in UNTIMED else draw(st.none() | spans),
        draw(amounts(kind)) if KINDS[kind].amount else None,
        draw(st.none() | numbers),
        draw(st.floats(EVERY_S, 100.0)) if repeated else None,
        draw(st.integers(1, 20)) if repeated else None,
    )


scenarios = st.lists(entries(), min_size=1, max_size=5).map(lambda some: Scenario(tuple(some)))


def toml(entry: Entry) -> str:
    """An entry as it is written."""

    def value(what: Any) -> str:
        if isinstance(what, tuple):
            return f"[{', '.join(map(value, what))}]"
        return f'"{what}"' if isinstance(what, str) else repr(what)

    fields = msgspec.structs.asdict(entry)
    fields["for"] = fields.pop("for_")
    given = {name: one for name, one in fields.items() if one is not None}
    return "[[fault]]\n" + "".join(f"{name} = {value(one)}\n" for name, one in given.items())


def between(chosen: float | str | None, span: Any) -> bool:
    """Whether what was chosen is what was written, or lies in its span."""
    if not isinstance(span, tuple):
        return chosen == span
    return span[0] - 0.001 <= chosen <= span[1] + 0.001


@given(scenarios, st.integers(0, 2**32))
def test_a_seed_chooses_within_the_spans(some: Scenario, seed: int) -> None:
    """The same each time."""
    chosen = choose(some, seed)
    assert chosen == choose(some, seed)
    assert len(chosen) == len(some.fault)
    for one, entry in zip(chosen, some.fault, strict=True):
        assert one.kind == entry.kind
        assert one.target in ((entry.target,) if isinstance(entry.target, str) else entry.target)
        assert between(one.at, entry.at)
        assert between(one.for_, entry.for_)
        assert between(one.amount, entry.amount)
        assert (one.within, one.every, one.times) == (entry.within, entry.every, entry.times)


def test_another_seed_chooses_otherwise() -> None:
    """Some do."""
    some = Scenario((Entry("kill", ("mule", "ox"), (0.0, 10.0)),))
    assert len({choose(some, seed) for seed in range(20)}) > 10


@given(scenarios)
def test_what_is_written_is_read(some: Scenario) -> None:
    """Every right scenario."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "faults.toml"
        file.write_text("\n".join(map(toml, some.fault)))
        assert load(file) == some


@given(scenarios, st.integers(0, 9))
def test_words_are_of_the_verb(some: Scenario, seed: int) -> None:
    """Kind and target first, then the amount; each option once, with its value."""
    for one in choose(some, seed):
        found = fault_arguments(one, 1000.0)
        assert found[:2] == [one.kind, one.target]
        rest = found[3:] if one.amount is not None and one.kind in AMOUNTS else found[2:]
        assert len(rest) % 2 == 0
        options = dict(zip(rest[::2], rest[1::2], strict=True))
        assert set(options) <= {
            "--at", "--for", "--within", "--per-second", "--every", "--times"
        }  # fmt: skip
        if isinstance(one.at, float):
            assert float(options["--at"].removeprefix("@")) == pytest.approx(1000.0 + one.at)


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("", "missing required field `fault`"),
        ("fault = []", "no \\[\\[fault\\]\\]"),
        ("[[fault]]\nkind = 3", "fault\\[0\\].kind"),
        (
            '[[fault]]\nkind = "explode"\ntarget = "ox"',
            "fault 1: there is no kind 'explode'; there are kill, ",
        ),
        ('[[fault]]\nkind = "kill"\ntarget = []', "fault 1: target names no process"),
        ('[[fault]]\nkind = "kill"\ntarget = "ox"\nwhen = 1', "unknown field `when`"),
        ('[[fault]]\nkind = "delay"\ntarget = "ox"', "delay needs an amount"),
        ('[[fault]]\nkind = "cut"\ntarget = "ox"\namount = 1', "cut has no amount"),
        ('[[fault]]\nkind = "restart"\ntarget = "ox"\nfor = 1', "restart has no `for`"),
        ('[[fault]]\nkind = "kill"\ntarget = "ox"\nat = [3.0, 1.0]', "at = \\[3, 1\\] is no span"),
        ('[[fault]]\nkind = "kill"\ntarget = "ox"\nfor = -1.0', "for = -1 is below 0 or no number"),
        ('[[fault]]\nkind = "kill"\ntarget = "ox"\nevery = 20', "`every` and `times` go together"),
        (
            '[[fault]]\nkind = "kill"\ntarget = "ox"\nevery = 0.0\ntimes = 3',
            "every = 0 is no number from 0.1 on",
        ),
        ('[[fault]]\nkind = "kill"\ntarget = "ox"\nevery = 1\ntimes = 0', "times = 0 is below 1"),
        ("[[fault", "faults.toml: "),
    ],
)
def test_what_is_wrong_is_named(tmp_path: Path, text: str, why: str) -> None:
    """With the file, and the number of the fault."""
    file = tmp_path / "faults.toml"
    file.write_text(text)
    with pytest.raises(UsageError, match=why) as caught:
        load(file)
    assert str(file) in str(caught.value)


def test_the_example_is_right() -> None:
    """That of the depot."""
    assert len(verbs.load(Path(__file__).parents[2] / "examples/depot/faults.toml").fault) == 3


def test_each_kind_is_told_and_called_by_the_verb() -> None:
    """With an example that fits its row: an amount where it needs one, --for only where it is
    healed after a time.
    """
    text, examples = inspect.getdoc(verbs.fault) or "", lazy.examples_of(verbs.fault)
    for kind in VERBS:
        assert f"\n{kind}: " in text
        called = [shlex.split(one) for one in examples if one.startswith(f"roco fault {kind} ")]
        assert called
        for _, _, *call in called:
            given = lazy.made("fault", verbs.fault).make_context("fault", call).params
            verbs.amount_of(kind, KINDS[kind], given["amount"], given["per_second"])
            assert given["for_"] is None or kind not in UNTIMED


@pytest.mark.parametrize(
    ("words", "why"),
    [
        (("explode", "ox"), "there is no kind of fault 'explode'; there are kill, "),
        (("delay", "ox"), "delay needs SECONDS behind the process"),
        (("loss", "ox", "3"), "loss: SHARE is 3; it must be 0.0001 at least, 1 at most"),
        (("flood", "ox", "--per-second", "0.5"), "0.5 is not in the range"),
        (("flood", "ox", "5"), "flood has no amount; leave 5 out"),
        (("kill", "ox", "5"), "kill has no amount; leave 5 out"),
        (("kill", "ox", "--per-second", "5"), "kill has no --per-second; a flood has"),
        (("kill", "ox", "--as", "mule"), "nobody speaks in a fault of kind kill; leave --as out"),
        (("restart", "ox", "--for", "1"), "restart has no --for"),
        (("kill", "ox", "--every", "20"), "--every and --times go together"),
        (("kill", "ox", "--times", "3"), "--every and --times go together"),
        (("kill",), "Missing argument 'PROCESS'"),
    ],
)
def test_what_does_not_fit_a_kind_is_wrong_use(
    tmp_path: Path, words: tuple[str, ...], why: str
) -> None:
    """Before a fleet is looked for."""
    assert why in printed("fault", *words, "--run-dir", tmp_path, code=2)["error"]


@pytest.mark.parametrize(
    "words", [["ox", "-3600"], ["ox", "-0.5", "--for", "2"], ["--for", "2", "ox", "3600"]]
)
def test_a_clock_goes_back_by_a_number_below_zero(words: list[str]) -> None:
    """It is an argument, no option; an unknown option is still told."""
    command = lazy.made("fault", verbs.fault)
    given = command.make_context("fault", ["clock", *words]).params
    assert given["amount"] == float(words[1 if words[0] == "ox" else 3])
    with pytest.raises(lazy.WrongUse):
        command.make_context("fault", ["clock", *words, "--fro", "2"])
