"""The meaning of a sentence, as read from its words alone: what comes of it depends on what was talked of before.

Must not know: the grammar, HTTP, tasks.
"""

import msgspec


class Thing(msgspec.Struct, frozen=True, omit_defaults=True):
    """A thing as it was named. `kinds`: what the word can mean, none for an unknown word; `number`: jar 2.

    `quality`: a colour, a size or a place beside the name. `ref`: it, other or both, in place of a name.
    """

    said: str
    kinds: tuple[str, ...] = ()
    number: int = 0
    quality: str = ""
    ref: str = ""


class Clause(msgspec.Struct, frozen=True, omit_defaults=True):
    """One wish or question: a row of the catalogue, and what was named in it, in the order of the words.

    `lacks`: something that the wish needs was left out.
    """

    does: str
    things: tuple[Thing, ...] = ()
    side: str = ""
    task: str = ""
    lacks: bool = False


class When(msgspec.Struct, frozen=True, omit_defaults=True):
    """Times at which the wishes of a sentence are wanted. `urgent`: before all else; `within_s`: seconds until they are
    done, `later_s`: until they may begin.

    `by`, `at`: the same as times of day in minutes; three o'clock is two of them, by night and by day.
    """

    urgent: bool = False
    within_s: float = 0.0
    by: tuple[int, ...] = ()
    later_s: float = 0.0
    at: tuple[int, ...] = ()


class Meaning(msgspec.Struct, frozen=True, omit_defaults=True):
    """A sentence: its clauses in order, none where it is not understood, and then why, in the catalogue's terms.

    `when` they are wanted. `guessed`: words were taken for others that are written alike. `strange`: the first word
    that nobody knows.
    """

    language: str = "en"
    clauses: tuple[Clause, ...] = ()
    guessed: bool = False
    why: str = ""
    strange: str = ""
    when: When = When()
