"""How conversations go, told independently of the tables: the drawings of the standard, and the law of cancel.

A story is words between an initiator `i` and a participant `p`, and how it ends for each:

    i:cfp            i says cfp, and p takes it
    i>cfp            i says cfp; it is on its way
    p<               p takes what is first on its way to it
    p:inform[final]  an inform of that kind; [cancel]: in reply to the cancel
    p!               p has forgotten the conversation
"""

from collections.abc import Iterator
from typing import NamedTuple

OPEN = ""
"""A story may stop while the conversation is open."""


class Story(NamedTuple):
    """`words` in order; `ends`: states of initiator and participant."""

    words: tuple[str, ...]
    ends: tuple[str, str]

    def __str__(self) -> str:
        return f"{' '.join(self.words)} -> {'/'.join(self.ends)}"


# SC00026H, SC00028H, SC00029H, SC00030H, SC00036H, SC00033H, SC00034H: the ways through the drawings.
DRAWINGS = {
    "request": """
        i:request p:refuse -> refused
        i:request p:failure -> failed
        i:request p:inform -> done
        i:request p:agree p:failure -> failed
        i:request p:agree p:inform[progress] p:inform[progress] p:inform -> done
    """,
    "request-when": """
        i:request-when p:refuse -> refused
        i:request-when p:agree p:inform -> done
        i:request-when p:agree p:failure -> failed
    """,
    "cfp": """
        i:cfp p:refuse -> refused
        i:cfp p:propose i:reject-proposal -> rejected
        i:cfp p:propose i:accept-proposal p:inform -> done
        i:cfp p:propose i:accept-proposal p:failure -> failed
    """,
    "icfp": """
        i:cfp p:refuse -> refused
        i:cfp p:propose i:reject-proposal -> rejected
        i:cfp p:propose i:cfp p:refuse -> refused
        i:cfp p:propose i:cfp p:propose i:cfp p:propose i:accept-proposal p:inform -> done
        i:cfp p:propose i:accept-proposal p:failure -> failed
    """,
    "propose": """
        i:propose p:accept-proposal -> accepted
        i:propose p:reject-proposal -> rejected
    """,
    "brokering": """
        i:proxy p:refuse -> refused
        i:proxy p:agree p:failure -> failed
        i:proxy p:agree p:inform p:inform p:inform[final] -> done
        i:proxy p:agree p:inform p:inform p:failure -> failed
        i:proxy p:agree p:inform p:inform[final] -> done
    """,
    "recruiting": """
        i:proxy p:refuse -> refused
        i:proxy p:agree p:failure -> failed
        i:proxy p:agree p:inform -> done
    """,
}

FAILURE_ENDS = frozenset(("request",))
"""Where a cancel that failed ends the conversation as well: nothing of the act is left."""
BEGINNINGS = frozenset(("agree", "propose"))
"""What a participant that was told to stop no longer says."""


def told(protocol: str) -> tuple[Story, ...]:
    """Every story of a protocol, drawings and cancels."""
    if protocol in _WRITTEN_OUT:
        return _WRITTEN_OUT[protocol]()
    drawings = tuple(_read(DRAWINGS[protocol]))
    found = dict.fromkeys(drawings)
    for story in drawings:
        for cut in range(1, len(story.words)):
            found.update(dict.fromkeys(_cancels(protocol, story, cut)))
    return tuple(found)


def _read(text: str) -> Iterator[Story]:
    for line in text.strip().splitlines():
        words, _, end = line.partition("->")
        ends = end.strip().split("/")
        yield Story(tuple(words.split()), (ends[0], ends[-1]))


def _cancels(protocol: str, story: Story, cut: int) -> Iterator[Story]:
    """The law of the cancel meta-protocol, applied where `cut` words of a drawing's story are said."""
    before, after = story.words[:cut], story.words[cut:]
    ends = FAILURE_ENDS & {protocol}
    yield Story((*before, "i:cancel", "p:inform[cancel]"), ("cancelled", "cancelled"))
    failed = (*before, "i:cancel", "p:failure[cancel]")
    yield Story(failed, ("cancelled", "cancelled")) if ends else Story((*failed, *after), story.ends)
    if cut == 1:
        yield Story((*before, "p!", "i:cancel", "p:failure[cancel]"), (OPEN, "settled"))
    if not after or after[0].startswith("i"):
        return
    yield from _crossed(before, after, story, failure_ends=bool(ends))
    if len(after) == 1:  # it comes to its end while it stops
        yield Story((*before, "i:cancel", *after, "p:failure[cancel]"), ("settled", "settled"))
    elif "[progress]" in after[0] or (after[0] == "p:inform" and before[-1] == "p:inform"):
        yield Story((*before, "i:cancel", after[0], "p:inform[cancel]"), ("cancelled", "cancelled"))


def _crossed(before: tuple[str, ...], after: tuple[str, ...], story: Story, *, failure_ends: bool) -> Iterator[Story]:
    """p's next words are said before it hears of the cancel."""
    count = next((n for n, word in enumerate(after) if word.startswith("i")), len(after))
    for many in range(1, count + 1):
        said = tuple(word.replace(":", ">") for word in after[:many])
        met = (*before, "i>cancel", *said, "p<", *("i<",) * many)
        if many == len(after):
            yield Story((*met, "p:failure[cancel]"), ("settled", "settled"))
            return
        yield Story((*met, "p:inform[cancel]"), ("cancelled", "cancelled"))
        failed = (*met, "p:failure[cancel]")
        yield Story(failed, ("cancelled", "cancelled")) if failure_ends else Story((*failed, *after[many:]), story.ends)


# --- the two that may be asked again ----------------------------------------------------------------------------------

_ENDS = {"inform": "done", "inform-ref": "done", "refuse": "refused", "failure": "failed"}


def _queries() -> tuple[Story, ...]:
    """SC00027H, and every pair of answers to two copies of one question."""
    stories = []
    for query in ("query-if", "query-ref"):
        for first, end in _ENDS.items():
            stories.append(Story((f"i:{query}", f"p:{first}"), (end, end)))
            stories.append(Story((f"i>{query}", f"i>{query}", "p<", "p<", f"p:{first}"), (end, end)))
            for second in _ENDS:
                words = (f"i>{query}", f"i>{query}", "p<", f"p:{first}", "p<", f"p:{second}")
                stories.append(Story(words, (end, _ENDS[second])))
    return tuple(stories)


_SUBSCRIPTIONS = """
    i:subscribe p:refuse -> refused
    i:subscribe p:failure -> failed
    i:subscribe p:agree p:inform p:inform p:failure -> failed
    i:subscribe p:inform p:inform p:failure -> failed
    i>subscribe i>subscribe p< p< p:agree p:failure -> failed
    i>subscribe i>subscribe p< p:agree p< p:agree p:failure -> failed
    i>subscribe i>subscribe p< p:refuse p< p:refuse -> refused
    i>subscribe i>subscribe p< p:failure p< p:failure -> failed
    i:subscribe i:cancel p:inform[cancel] -> cancelled
    i:subscribe i:cancel p:failure[cancel] -> cancelled
    i:subscribe p:agree p:inform i:cancel p:inform[cancel] -> cancelled
    i:subscribe p:agree i:cancel p:failure[cancel] -> cancelled
    i:subscribe i>cancel p>agree p>inform i< i< p< p:inform[cancel] -> cancelled
    i:subscribe i>cancel p>inform p>inform i< i< p< p:inform[cancel] -> cancelled
    i>subscribe i>subscribe p< p>agree i>cancel i< p< p>agree p< i< p:inform[cancel] -> cancelled
    i:subscribe i>cancel p>agree p>failure i< i< p< p:failure[cancel] -> settled
    i:subscribe i>cancel p>refuse i< p< p:failure[cancel] -> settled
    i:subscribe i>cancel p>failure i< p< p:failure[cancel] -> settled
    i:subscribe p:agree i>cancel p>failure i< p< p:failure[cancel] -> settled
    i>subscribe i>subscribe i>cancel p< p>refuse p< p>refuse i< i< p< p:failure[cancel] -> settled
    i>subscribe i>subscribe i>cancel p< p>failure p< p>failure i< i< p< p:failure[cancel] -> settled
    i>subscribe i>subscribe p< p>agree i< i>cancel p< p>agree i< p< p:inform[cancel] -> cancelled
    i:subscribe p! i:cancel p:failure[cancel] -> cancelled/settled
"""

_WRITTEN_OUT = {"query": _queries, "subscribe": lambda: tuple(_read(_SUBSCRIPTIONS))}
