"""Words about time: taken out of a sentence, with the same meaning in each of their forms."""

from hypothesis import given
from hypothesis import strategies as st

from services.human_interface import times
from services.human_interface.catalogue import CATALOGUE
from services.human_interface.device_messages import When
from services.human_interface.grammar import VOCABULARY, understand
from services.human_interface.interpretation import Act, Context, outcome

POLISH = ("najpierw", "jak najszybciej", "do godziny 15", "o 15:30")
PLAIN = When()
WORDS = sorted(VOCABULARY | {",", "first", "within", "by", "noon", "10", "15:30"})


MINUTES = {
    "within ten minutes": 10, "within 10 minutes": 10, "within a minute": 1,
    "within half an hour": 30, "within a quarter of an hour": 15, "in less than 90 seconds": 1.5,
    "w ciągu dziesięciu minut": 10, "w ciągu godziny": 60, "within 1 hour and 30 minutes": 90,
    "within 2 minutes, 30 seconds": 2.5, "w ciągu 1 godziny 30 minut": 90,
}  # fmt: skip
LATER = {
    "in ten minutes": 10, "in half an hour": 30, "five minutes from now": 5,
    "za dziesięć minut": 10, "za godzinę": 60, "in two and a half minutes": 2.5,
    "two and a half minutes from now": 2.5,
    "in an hour and a half": 90, "in 1 hour 30 minutes": 90, "in 2.5 minutes": 2.5,
    "2.5 minutes from now": 2.5, "za dwie i pół minuty": 2.5, "za półtorej godziny": 90,
    "za godzinę i kwadrans": 75, "za 2,5 minuty": 2.5,
}  # fmt: skip
BY = {
    "before noon": (720,), "by half past three": (210, 930), "by 3:30": (210, 930),
    "by 3:30 am": (210,), "by 15:30": (930,), "by 12 pm": (720,), "by 12 am": (0,),
    "by quarter to four": (225, 945), "by three o'clock": (180, 900), "przed południem": (720,),
    "do godziny 15": (900,),
}  # fmt: skip
AT = {
    "at noon": (720,), "not before 15:30": (930,), "after half past three": (210, 930),
    "o 15:30": (930,), "at 03:30": (210,),
}  # fmt: skip
FIRST = (
    "first", "first, please", "before anything else", "urgently", "najpierw", "jak najszybciej",
)  # fmt: skip
TIMES = (
    {words: When(within_s=60.0 * minutes) for words, minutes in MINUTES.items()}
    | {words: When(later_s=60.0 * minutes) for words, minutes in LATER.items()}
    | {words: When(by=by) for words, by in BY.items()}
    | {words: When(at=at) for words, at in AT.items()}
    | dict.fromkeys(FIRST, When(urgent=True))
    | {"at noon, within 90 seconds": When(within_s=90.0, at=(720,))}
)


def test_words_about_time_leave_the_wish_as_it_is():
    """Behind the wish, and with a comma; the wish is the same as without them."""
    wishes = {wish: understand(wish).clauses for wish in ("weź słoik", "take it")}
    assert all(wishes.values())
    for words, when in TIMES.items():
        wish = "weź słoik" if not words.isascii() or words in POLISH else "take it"
        for sentence in (f"{wish} {words}", f"{wish}, {words}."):
            found = understand(sentence)
            assert (found.clauses, found.when) == (wishes[wish], when), sentence


NOT_UNDERSTOOD = (
    "take the jar in ten", "take the jar at 25:10", "take the jar before the bowl",
    "take the jar by 25:10",
    "take the jar by 13 pm", "take the jar within ten", "take the jar in -5 minutes",
    "take the jar within -5 minutes",
     "take the jar -5 minutes from now", "take the jar in \u22125 minutes",
     "take the jar in minus five minutes",
     "take the jar minus five minutes from now", "weź słoik za -5 minut",
     "take the jar twenty five minutes from now",
     "take the jar at 03:60", "take the jar in 1 2 minutes", "take the jar before you pour",
     "first",
)  # fmt: skip


def test_what_is_not_understood_of_time_is_not_left_out():
    """Nothing is done of such a sentence, rather than something at another time."""
    found = [(one, outcome(understand(one), Context())) for one in NOT_UNDERSTOOD]
    assert [sentence for sentence, done in found if isinstance(done, Act)] == []


def test_first_of_two_wishes_is_their_order():
    """At the beginning it parts the wishes of a sentence, as before; "the first" is a thing."""
    assert understand("first take the jar, then put it down").when == PLAIN
    assert understand("take the first").when == PLAIN


@given(st.lists(st.sampled_from(WORDS), max_size=12))
def test_what_is_left_are_words_of_the_sentence_in_their_order(words):
    """Nothing is added, and a sentence never becomes empty."""
    rest, when = times.split_time(tuple(words))
    left = iter(words)
    assert all(word in left for word in rest)
    assert rest or not words
    assert when != PLAIN or rest == tuple(words)


@given(st.integers(0, 23), st.integers(0, 59), st.floats(0.0, 1439.9))
def test_a_deadline_is_the_next_such_time_of_the_clock(hour, minute, now):
    """At most a day ahead, and then the clock shows it."""
    at, *others = understand(f"take the jar by {hour}:{minute:02}").when.by
    left_s = times.seconds_left(When(by=(at, *others)), now)
    assert 0.0 <= left_s <= 86400.0
    shown = (now + left_s / 60.0) % 1440.0
    meant = [60 * hour + minute + 720 * half for half in (-1, 0, 1)]
    assert min(min(abs(shown - one), 1440.0 - abs(shown - one)) for one in meant) < 0.01


CLOCKS = (
    ("16:00", "three o'clock", "15:00"), ("16:00", "quarter to five", "16:45"),
    ("6:00", "three o'clock", "15:00"), ("21:59", "half past five", "17:30"),
    ("22:00", "half past five", "5:30"), ("23:00", "three o'clock", "3:00"),
    ("2:00", "three o'clock", "3:00"), ("16:00", "eleven o'clock", "23:00"),
    ("16:00", "twelve o'clock", "12:00"), ("16:00", "3 am", "3:00"),
    ("16:00", "03:00", "3:00"), ("16:00", "midnight", "0:00"),
)  # fmt: skip


def test_who_speaks_by_day_means_no_time_at_night():
    """Unless it is said: a clock shows three o'clock twice a day."""
    for now, said, meant in CLOCKS:
        hour, minute = map(int, now.split(":"))
        when, at = understand(f"take the jar at {said}").when, 60 * hour + minute
        assert when.at
        then = (at + times.seconds_until(when, at) / 60.0) % 1440.0
        assert f"{int(then // 60)}:{int(then % 60):02}" == meant, (now, said)
        assert times.seconds_left(When(by=when.at), at) == times.seconds_until(when, at)


def test_the_sooner_of_two_limits_counts():
    """Within an hour and by noon. A time to begin is no deadline."""
    when, later = When(within_s=3600.0, by=(720,)), When(later_s=3600.0, at=(720,))
    left, until = times.seconds_left, times.seconds_until
    assert [left(when, 700.0), left(when, 600.0), left(PLAIN, 600.0)] == [1200.0, 3600.0, 0.0]
    assert [until(later, 700.0), left(later, 700.0), until(when, 700.0)] == [1200.0, 0.0, 0.0]


def test_each_language_has_all_rows_about_time():
    """Else a person would be understood by half."""
    for rows in (CATALOGUE.time, CATALOGUE.number, CATALOGUE.unit, CATALOGUE.clock):
        assert set(rows) == {"en", "pl"}
