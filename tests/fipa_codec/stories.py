"""Expected conversations, independent of the tables: the diagrams of the standard, and the rules of
cancel.

A story is a sequence of steps of an initiator `i` and a participant `p`, with the final state of
each:

    i:cfp            i sends cfp, and p receives it
    i>cfp            i sends cfp; it is in transit
    p<               p receives the first message in transit to it
    p:inform[final]  p sends an inform of that kind; [cancel]: in reply to the cancel
    p!               p has forgotten the conversation
"""

from collections.abc import Iterator
from typing import NamedTuple

OPEN = ""
"""The final state of a conversation that is still open."""


class Story(NamedTuple):
    """`words`: the steps in order; `ends`: final states of initiator and participant."""

    words: tuple[str, ...]
    ends: tuple[str, str]

    def __str__(self) -> str:
        return f"{' '.join(self.words)} -> {'/'.join(self.ends)}"


# SC00026H to SC00036H: the paths through the diagrams.
DIAGRAMS = {
    "fipa-request": """
        i:request p:refuse -> refused
        i:request p:failure -> failed
        i:request p:inform -> done
        i:request p:agree p:failure -> failed
        i:request p:agree p:inform -> done
    """,
    "fipa-query": """
        i:query-ref p:refuse -> refused
        i:query-ref p:failure -> failed
        i:query-ref p:inform -> done
        i:query-if p:agree p:failure -> failed
        i:query-if p:agree p:inform -> done
    """,
    "fipa-subscribe": """
        i:subscribe p:refuse -> refused
        i:subscribe p:failure -> failed
        i:subscribe p:agree p:inform p:inform p:failure -> failed
        i:subscribe p:inform p:inform p:failure -> failed
    """,
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
"""Protocols in which a failed cancel ends the conversation too, since the act is over."""


def stories_of(protocol: str) -> tuple[Story, ...]:
    """Return every story of a protocol: those of the diagrams, and each with a cancel at every
    step.
    """
    if protocol in _EXPLICIT:
        return _EXPLICIT[protocol]()
    drawings = tuple(_read(DIAGRAMS[protocol]))
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
    """Yield the stories with a cancel after the first `cut` steps, by the rules of the cancel
    meta-protocol.
    """
    before, after = story.words[:cut], story.words[cut:]
    ends = FAILURE_ENDS & {protocol}
    yield Story((*before, "i:cancel", "p:inform[cancel]"), ("cancelled", "cancelled"))
    failed = (*before, "i:cancel", "p:failure[cancel]")
    yield (
        Story(failed, ("cancelled", "cancelled")) if ends else Story((*failed, *after), story.ends)
    )
    if cut == 1:
        yield Story((*before, "p!", "i:cancel", "p:failure[cancel]"), (OPEN, "settled"))
    if not after or after[0].startswith("i"):
        return
    yield from _crossed(before, after, story, failure_ends=bool(ends))
    if len(after) == 1:  # it ends while it stops
        yield Story((*before, "i:cancel", *after, "p:failure[cancel]"), ("settled", "settled"))
    elif "[progress]" in after[0] or (after[0] == "p:inform" and before[-1] == "p:inform"):
        yield Story((*before, "i:cancel", after[0], "p:inform[cancel]"), ("cancelled", "cancelled"))


def _crossed(
    before: tuple[str, ...], after: tuple[str, ...], story: Story, *, failure_ends: bool
) -> Iterator[Story]:
    """Yield the stories in which the next messages of p cross the cancel."""
    count = next((n for n, word in enumerate(after) if word.startswith("i")), len(after))
    for many in range(1, count + 1):
        said = tuple(word.replace(":", ">") for word in after[:many])
        met = (*before, "i>cancel", *said, "p<", *("i<",) * many)
        if many == len(after):
            yield Story((*met, "p:failure[cancel]"), ("settled", "settled"))
            return
        yield Story((*met, "p:inform[cancel]"), ("cancelled", "cancelled"))
        failed = (*met, "p:failure[cancel]")
        yield (
            Story(failed, ("cancelled", "cancelled"))
            if failure_ends
            else Story((*failed, *after[many:]), story.ends)
        )


# --- the paper's two with repeated openings -------------------------------------------------------

_ENDS = {"inform": "done", "inform-ref": "done", "refuse": "refused", "failure": "failed"}


def _queries() -> tuple[Story, ...]:
    """Return the stories of the paper's query, and every pair of answers to two copies of one
    query.
    """
    stories = []
    for query in ("query-if", "query-ref"):
        for first, end in _ENDS.items():
            stories.append(Story((f"i:{query}", f"p:{first}"), (end, end)))
            stories.append(
                Story((f"i>{query}", f"i>{query}", "p<", "p<", f"p:{first}"), (end, end))
            )
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

_EXPLICIT = {"query": _queries, "subscribe": lambda: tuple(_read(_SUBSCRIPTIONS))}
