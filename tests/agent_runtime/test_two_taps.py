"""Out of two taps one stream: everything once, in order, whichever of the two has no router for a while."""

import threading
from collections import Counter

from hypothesis import given
from hypothesis import strategies as st

from agent_runtime.core.peers import LINKED_GRACE_S
from agent_runtime.io.tap import Sample
from agent_runtime.io.two_taps import TWIN_S, Twins


class Stream:
    """The stream handed on from two taps that have their routers."""

    def __init__(self) -> None:
        self.samples: list[Sample] = []
        self.vanished = threading.Event()
        self.twins = Twins(self._take)
        for which in (0, 1):
            self.twins.router(which, True, 0.0)

    def _take(self, sample: Sample) -> None:
        self.samples.append(sample)
        if sample.gone:
            self.vanished.set()

    @property
    def said(self) -> list[bytes]:
        """Return what was handed on of words."""
        return [one.data for one in self.samples if one.data]


def word(text: bytes, at: float = 1.0) -> Sample:
    """Something that is said."""
    return Sample("roco/x/said", text, at)


def token(at: float = 1.0, *, gone: bool = False) -> Sample:
    """The token of an agent."""
    return Sample("roco/x/_/alive/co/1", b"", at, token=True, gone=gone)


@given(st.lists(st.sampled_from([b"a", b"b", b"c"]), max_size=8), st.lists(st.booleans()))
def test_each_is_handed_on_once_and_in_order(said: list[bytes], turns: list[bool]) -> None:
    """Also what is said twice; however the two taps take turns."""
    stream, at = Stream(), [0, 0]
    for which in (*turns, *[False] * len(said), *[True] * len(said)):
        if at[which] < len(said):
            stream.twins.heard(which, word(said[at[which]]))
            at[which] += 1
    assert stream.said == said


@given(st.integers(0, 6), st.integers(0, 6))
def test_nothing_is_missed_when_one_router_dies(first: int, second: int) -> None:
    """However far each tap had come: the other one goes on, and nobody was deaf."""
    said, stream = [bytes([65 + n]) for n in range(6)], Stream()
    for which, until_now in ((0, first), (1, second)):
        for text in said[:until_now]:
            stream.twins.heard(which, word(text))
    stream.twins.router(0, False, 2.0)
    for text in said[second:]:
        stream.twins.heard(1, word(text))
    assert Counter(stream.said) == Counter(said)
    stream.twins.router(0, True, 9.0)
    for which in (1, 0):
        stream.twins.heard(which, word(b"A", 9.0))
    assert Counter(stream.said) == Counter([*said, b"A"])
    assert not any(one.deaf_since for one in stream.samples)


def test_without_both_routers_it_is_deaf_until_the_first_is_back() -> None:
    """From the loss of the second one on."""
    stream = Stream()
    stream.twins.router(1, False, 1.0)
    stream.twins.router(0, False, 2.0)
    stream.twins.router(1, True, 3.0)
    stream.twins.router(0, True, 4.0)
    assert [(one.deaf_since, one.at) for one in stream.samples] == [(2.0, 3.0)]


def test_a_twin_that_does_not_come_is_forgotten() -> None:
    """Later words are not taken for it, and memory does not grow."""
    stream = Stream()
    stream.twins.heard(0, word(b"a", 1.0))
    stream.twins.heard(0, word(b"b", 1.1 + TWIN_S))
    stream.twins.heard(1, word(b"a", 1.2 + TWIN_S))
    assert stream.said == [b"a", b"b", b"a"]


def test_a_token_that_comes_over_to_the_other_router_never_went() -> None:
    """It vanishes at both, and is back within the grace."""
    stream = Stream()
    for gone in (False, True, False):
        for which in (0, 1):
            stream.twins.heard(which, token(gone=gone))
    assert not stream.vanished.wait(2 * LINKED_GRACE_S)
    assert stream.samples == [token()]


def test_a_token_that_vanishes_at_both_is_told_once() -> None:
    """After the grace."""
    stream = Stream()
    for gone in (False, True):
        for which in (0, 1):
            stream.twins.heard(which, token(gone=gone))
    assert stream.vanished.wait(20.0)
    assert [(one.token, one.gone) for one in stream.samples] == [(True, False), (True, True)]
