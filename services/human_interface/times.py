"""Times, as people say them: "first", "within ten minutes", "before noon", "in ten minutes".

Such words are taken out of a sentence before the grammar reads the rest; words about time that are
not understood stay, so that the grammar refuses the sentence. By the catalogue. Must not know:
tasks, clocks.
"""

import re

from msgspec.structs import replace

from services.human_interface.catalogue import CATALOGUE, LANGUAGES
from services.human_interface.device_messages import When

HALF_DAY, DAY = 12 * 60, 24 * 60
MORNING, NIGHT = 6 * 60, 22 * 60  # estimate: who says three o'clock between them means three by day


def _choice(words: object) -> str:
    return "|".join(sorted(words, key=len, reverse=True))  # type: ignore[call-overload]


def _part(language: str) -> str:
    """Return the expression of a part of a duration: number, half, unit, half."""
    number = rf"(\d{{1,4}}(?:[.,]\d{{1,2}})?|{_choice(CATALOGUE.number[language])})"
    text = re.sub(r"\bN\b", lambda _: number, CATALOGUE.time[language].part)
    return text.replace("UNIT", f"({_choice(CATALOGUE.unit[language])})")


_TIME_PART = {language: re.compile(rf"\b{_part(language)}\b") for language in LANGUAGES}


def _expression(text: str, language: str) -> re.Pattern[str]:
    """Return a row of the catalogue as an expression over words with a blank between them."""
    numbers = _choice(CATALOGUE.number[language])
    hour = rf"\d{{1,2}}|{numbers}"
    spoken = (
        rf"half past (?:{hour})|quarter (?:past|to) (?:{hour})|(?:{hour}) o clock|godziny"
        rf" (?:{hour})|{_choice([*CATALOGUE.hour[language], '-'])}"
    )
    half = rf"(?: (?:[ap]m|{_choice(CATALOGUE.half[language])}))?"
    clock = (
        rf"\d{{1,2}}:\d\d{half}|\d{{1,2}} ?[ap]m|(?:{spoken}){half}"
        rf"|{_choice(CATALOGUE.clock[language])}"
    )
    text = text.replace("\n", "").replace("CLOCK", f"({clock})")
    part = re.sub(r"\((?!\?)", "(?:", _part(language))
    text = text.replace(
        "DURATION", f"({part}(?: (?:(?:{CATALOGUE.time[language].plus}) )?{part})*)"
    )
    return re.compile(rf"(?:^| )(?:{text})(?= |$)")


_URGENT, _WITHIN, _BY, _LATER, _AT = (
    {
        language: _expression(getattr(CATALOGUE.time[language], kind), language)
        for language in LANGUAGES
    }
    for kind in ("urgent", "within", "by", "later", "at")
)


def split_time(words: tuple[str, ...]) -> tuple[tuple[str, ...], When]:
    """Return the words without those that say when, and what these say; all of them where nothing
    else is left.
    """
    text, when = " ".join(words), When()
    for language in LANGUAGES:
        if found := _WITHIN[language].search(text):
            when = replace(when, within_s=_seconds(found, language))
            text = _without_time(text, found)
        if (found := _BY[language].search(text)) and (by := _clocks(found.group(1), language)):
            text, when = _without_time(text, found), replace(when, by=by)
        if found := _LATER[language].search(text):
            when = replace(when, later_s=_seconds(found, language))
            text = _without_time(text, found)
        if (found := _AT[language].search(text)) and (at := _clocks(found.group(1), language)):
            text, when = _without_time(text, found), replace(when, at=at)
        # behind the others: "first" is the last word of what is left
        if found := _URGENT[language].search(text):
            text, when = _without_time(text, found), replace(when, urgent=True)
    rest = tuple(text.split())
    return (rest, when) if any(word != "," for word in rest) else (words, When())


def _without_time(text: str, found: re.Match[str]) -> str:
    return text[: found.start()] + text[found.end() :]


def _seconds(found: re.Match[str], language: str) -> float:
    """The sum of the parts of the duration that was found."""
    seconds = 0.0
    for part in _TIME_PART[language].finditer(next(one for one in found.groups() if one)):
        number, half, unit, half_more = part.groups()
        amount = (_number(number, language) if number else 1.0) + (
            0.5 if half or half_more else 0.0
        )
        seconds += amount * CATALOGUE.unit[language][unit]
    return seconds


def _number(word: str, language: str) -> float:
    return (
        float(word.replace(",", ".")) if word[0].isdecimal() else CATALOGUE.number[language][word]
    )


def _clocks(said: str, language: str) -> tuple[int, ...]:
    """The times of day that are meant, in minutes."""
    if said in CATALOGUE.clock[language]:
        return (CATALOGUE.clock[language][said],)
    said, half = _without_half(said, language)
    if found := re.fullmatch(r"(\d+):(\d+)", said):
        if found[1].startswith("0") and not half and int(found[2]) < 60:  # 03:30 is by night
            return (60 * int(found[1]) + int(found[2]),)
        return _of_day(int(found[1]), int(found[2]), half)
    if found := re.fullmatch(r"(\d+) ?([ap]m)", said):
        return _of_day(int(found[1]), 0, found[2])
    if said in CATALOGUE.hour[language]:
        return _of_day(CATALOGUE.hour[language][said], 0, half)
    if said.isdecimal():
        return _of_day(int(said), 0, half)
    plain = re.sub(r"half past |quarter past |quarter to | o clock|godziny ", "", said)
    hour = int(_number(plain, language))
    past = {"half": 30, "quarter": 15}.get(said.partition(" ")[0], 0)
    return _of_day(hour, -past if said.startswith("quarter to") else past, half)


def _without_half(said: str, language: str) -> tuple[str, str]:
    """A time of day without the words for its half of the day, and which one that is; "" for
    none.
    """
    halves = {"am": "am", "pm": "pm"} | CATALOGUE.half[language]
    for words, half in halves.items():
        if said.endswith(f" {words}"):
            return said.removesuffix(f" {words}"), half
    return said, ""


def _of_day(hour: int, minute: int, half: str) -> tuple[int, ...]:
    """The times of day of a clock's time; none for one that no clock shows."""
    if hour > 24 or minute > 59 or (half and not 1 <= hour <= 12):
        return ()
    at = 60 * hour + minute
    if half:
        return ((at % HALF_DAY + (HALF_DAY if half == "pm" else 0)) % DAY,)
    return (at % HALF_DAY, at % HALF_DAY + HALF_DAY) if 1 <= hour <= 12 else (at % DAY,)


def seconds_left(when: When, minute_of_day: float) -> float:
    """Return the seconds until it is to be done, from the asker's time of day [min]; 0 where
    nothing was said.
    """
    return _sooner(when.within_s, when.by, minute_of_day)


def seconds_until(when: When, minute_of_day: float) -> float:
    """Return the seconds until it may begin, from the asker's time of day [min]; 0 where nothing
    was said.
    """
    return _sooner(when.later_s, when.at, minute_of_day)


def _sooner(after_s: float, clocks: tuple[int, ...], minute_of_day: float) -> float:
    """The sooner one. Of two times of day who speaks by day does not mean the one by night."""
    if MORNING <= minute_of_day < NIGHT:
        clocks = tuple(at for at in clocks if at >= MORNING) or clocks
    ahead = [(at - minute_of_day) % DAY * 60.0 for at in clocks]
    return min([after_s] * (after_s > 0.0) + ahead, default=0.0)
