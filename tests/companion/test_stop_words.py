"""Words that stop the robot: found whatever else is said, and never in a plain command."""

import string
import subprocess
import sys
import time
import unicodedata

import pytest
from confusable_homoglyphs.confusables import confusables_data
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.stop_words import (
    APOSTROPHES,
    LONGEST,
    ROWS,
    calls_for_help,
    fold,
    forms,
    may_answer,
    stop_words,
)

STOPS = """
stop|STOP!!!|Stop it.|please stop|stop stop stop|stooooop
S T O P|s.t.o.p.|stpo|sotp|stp|stopp!|halt|HALT!|freeze|freeeze
emergency stop|e-stop|emergency!|stop the robot|stop moving|can you stop please|robot, stop
Velma stop now
careful|be careful|careful with that|hang on|hang on a second|hold on|hold it|wait|wait a minute
wait, not that one
no|nie|no don't|no, don’t|dont|do not|don't touch that|don't pour the milk|please don't do that
you must not take it
no no|no no no|no, wait|whoa|woah|watch out|look out!|ouch|that hurts|you are hurting me
it is falling|pause|abort
that's enough|enough|back off|hands off|let go of me|leave me alone|not so fast|slow down
stand still|stay where you are
cut it out|just a second|one moment!|a moment, please|take the jar, no, stop
pour the jar into the bowl... careful!
don't stop|danger|How do I stop you? Stop!|in a second, stop|I don't know, wait
stój|STÓJ!|stoj|zatrzymaj się|Zatrzymaj to natychmiast|przestań|czekaj|poczekaj chwilę|uważaj
ostrożnie|nie rób tego
nie ruszaj się|nie, nie|dość|wystarczy|chwila|zostaw to|weź słoik, nie, czekaj|nie lej mleka
niebezpiecznie|chwileczkę
help|help, I've fallen|can you help me|it burns|I can't breathe|let go!|please let go now|ow
that hurt|get away from me
oh no please|you've spilled it|ała|auć|ściskasz mi palce|parzy mnie|puść mnie|duszę się|pomóż mi
pomocy|pomoc
proszę nie bierz tego|proszę, nie|cant breathe|youve spilled it|can t breathe|its burning
ur hurting me
my hair is caught|fire!|call an ambulance|I'm stuck|you dropped it|there's a child
get your hands off|I don't want that
rozlałeś mleko|pali się!|dzwoń po karetkę|krew mi leci|nie mogę oddychać|odsuń się ode mnie
upuściłaś słoik|boję się
st0p|ha1t|b1eeding|HE1P|fa11ing|h e l p|s t 0 p|stop_it|ѕтор|ＳＴＯＰ|s\u200btop|ﬁre
🛑|✋🏽|🖐️ velma|🆘
Don't! Forget it!|do not - forget it - stop|Don't, forget it.|I can't! Wait!|Nie! Przestawaj!
NO! dobra
nie spiesz się tak|nie ma mowy|leave off!|for the children's sake|I don't have it, stop
don't forget to stop
Enough! About me
stob it|stob it stob it|sotp please robot|stopit|stopnow|pleasestop|stopstop|stawp it right now
stój stój!
swtop that|my hand is caught|when I say stop I mean it|stop by the table
I want that to stop, never mind
it'll spill|it'll break|that'll do|that will do, thank you|that's plenty|half a mo
it's going everywhere|don't bother me|I fell|sypiesz obok|leci na podłogę|nie mogę się ruszyć
"""
NO_STOPS = """
take the jar|pour the content of the jar into the bowl|put down the jar|put the jar on the table
look around|cancel
status|take the jar carefully|hold the jar|take the jar and hold it|what do you see?
why have you stopped?|I don't know
never mind|forget it|take the one with the lid|step|the shop|I do not see the jar
why don't you take the jar?|now
can't you take the jar|take the jar with the left hand|undo that|what are you waiting for
the bowl, not the jar
weź słoik|postaw słoik na stole|rozejrzyj się|nie wiem|co widzisz?|weź słoik ostrożnie|anuluj|stół
sto
how do I stop you?|How can I stop the robot?|why did you stop?|what happens if I stop you?
nie szkodzi
nie ma za co|jak cię zatrzymać?|Jak mogę cię zatrzymać?|dlaczego się zatrzymałeś?|nie ma sprawy
nie martw się
don't worry|no thank you|take the jar in one minute|in a second|take the jar in a second
take the jar in just a moment
weź słoik za chwilę|za chwilę|take the jar one minute from now|weź słoik za chwileczkę
za moment weź słoik
w ciągu minuty weź słoik|what can you do|what can I say?|how can you help me?|co umiesz
w czym możesz mi pomóc?|let go of the jar|drop it|take the one in front of me|hi-1-10
take jar 10|put it on table 1|open the jam jar
no rush, take the jar|don't forget the lid|I can't wait to see it|never forget the jar
kind enough to take it
I can't stop coughing|keep pouring until I say stop|the bus stop|don't stop on my account|mind you
he used to say halt who goes there|enough about me|so the flies don't get in|fair enough
that's terrific
keep it stable|hold on to the jar|I don't usually eat|a bowl for the kids
the doctor said I should eat
nie spiesz się|nie zapomnij o misce|nie przestawaj|nie ma pośpiechu|nie mogę się doczekać
nie bój się
nie mam siły|nie ma słoika na stole|nie mogę znaleźć miski|strasznie mi miło|swop hands velma
the top|gdzie stoi słoik
don't bother with it|mind passing me the jar|how do you feel?|what made you stop|the lid's stuck
help me find the jar|I don't need it any more|the table can wait|nie zatrzymuj się|nie sięgam
nie mogłabyś podać słoika|nie widziałaś miski|pomóż mi posprzątać|czemu nic nie robisz
"""


def said(table):
    """The sentences of a table."""
    return [one for one in table.replace("\n", "|").split("|") if one]


def test_these_stop():
    """Also in capitals, and with marks around."""
    ways = [way for one in said(STOPS) for way in (one, f"  {one.upper()}?!")]
    assert [one for one in ways if not stop_words(one)] == []


def test_these_do_not():
    """A robot that stopped at its ordinary commands would be of no use."""
    assert [one for one in said(NO_STOPS) if stop_words(one)] == []


# --- asides: what somebody says of himself, or as a reason, beside a wish -------------------------

WISHES = said(
    "take the jar|could you bring me the bowl please|I'd like you to put the box on the table|weź"
    " słoik|czy mogłabyś podać mi miskę|proszę wlać zawartość słoika do miski"
)
ASIDES = said(
    "my back hurts|I burnt my hand|I have a broken arm|my hands hurt|I don't want to drop it|I need"
    " help|well my doctor is coming|my fingers are too stiff|bolą mnie ręce|oparzyłam się wczoraj"
    "|nie dam rady|boję się że upuszczę|mam złamaną rękę"
)
REASONS = said(
    "before it falls|because the children are coming|or I will drop it|in case it breaks|zanim"
    " spadnie|żeby się nie rozlało|bo dzieci zaraz wrócą"
)
CRIES = said(
    "you hurt me|it hurts my hand|my finger is stuck|I am falling|don't touch the lid|I don't want"
    " you to move|it's falling|the jar is slipping|ow|so wait|boję się|boli mnie bo mnie ściskasz"
    "|nie ruszaj miski|parzy mnie|because you hit me|my dog is there|I fell|I am dizzy"
    "|my child|słabo mi"
)


@pytest.mark.parametrize("wish", WISHES)
def test_an_aside_beside_a_wish_does_not_stop(wish):
    """Before the wish, with a mark, a word or nothing between, and behind it."""
    before = [f"{one}{gap}{wish}" for one in ASIDES for gap in (", ", " so ", ". ", " ")]
    behind = [f"{wish}, {one}" for one in (*ASIDES, *REASONS)] + [
        f"{wish} {one}" for one in REASONS
    ]
    assert [one for one in (*before, *behind) if stop_words(one)] == []


CAUTIONS = said(
    " but be careful with it|, but don't spill any| without dropping it|, it's very hot|, tylko"
    " ostrożnie|, ale nie upuść|, uważaj na nią|, łatwo się tłucze"
)
QUESTIONS = said(
    "did it hurt?|have you spilled anything?|is the bowl too full?|what happened, did something"
    " fall?|why did you drop it|czy coś się stłukło?|czemu to upuściłaś?"
)


@pytest.mark.parametrize("wish", WISHES)
def test_a_caution_stops_unless_it_stands_behind_a_wish(wish):
    assert [one for one in CAUTIONS if stop_words(f"{wish}{one}")] == []
    alone = ("be careful with it", "don't spill any", "uważaj na nią")
    ways = [way for one in alone for way in (one, f"{one}, {wish}", f"look, {one}")]
    assert [one for one in ways if not stop_words(one)] == []


def test_questions_of_what_became_of_a_thing_do_not_stop():
    assert [one for one in QUESTIONS if stop_words(one)] == []


@pytest.mark.parametrize(
    "asked",
    said(
        "did you hurt me?|have you hurt somebody?|is it burning?|why did you hurt my hand|czy ktoś"
        " się skaleczył?|is the child hurt?|did you drop it? stop|is it falling?|it is broken"
    ),
)
def test_questions_about_people_and_what_goes_on_stop(asked):
    assert stop_words(asked)


def test_an_aside_without_a_wish_is_judged_by_its_words():
    assert [one for one in ASIDES if not stop_words(one)] == ["nie dam rady"]


@pytest.mark.parametrize("wish", [*WISHES, "don't take the jar", "nie bierz słoika"])
def test_a_cry_beside_a_wish_stops(wish):
    ways = [way for cry in CRIES for way in (f"{cry}, {wish}", f"{wish}, {cry}", f"{cry}! {wish}")]
    assert [one for one in ways if not stop_words(one)] == []


@pytest.mark.parametrize(
    "told",
    said(
        "my hand hurts, don't take the jar|my back hurts when I take the jar|I want to take the jar"
        " but my hand hurts|my hand hurts, not the jar|my hand hurts, the jar|boli mnie, nie bierz"
        " słoika|boli mnie, kiedy biorę słoik|my hand hurts when taking the jar"
        "|my hand hurts, never give me the jar|my hand hurts, did it break?"
    ),
)
def test_without_a_wish_of_the_robot_there_is_no_aside(told):
    assert stop_words(told)


# --- every row in every form ----------------------------------------------------------------------

ROWS_OF = {
    where: sorted(
        {form for one in ROWS.stop if one.where == where for form in forms(f"{one.en},{one.pl}")}
    )
    for where in ("anywhere", "opening", "alone", "answer")
}
FILLERS = [*forms(ROWS.fillers)]
INVISIBLE = (
    "\u200b\u200c\u200d\u2060\ufeff\u00ad\u200e\u202e\u2066\ufe0f\U000e0101\u034f\u180e\u3164"
)
SHORT = {
    "can not": "can't",
    "do not": "don't",
    "must not": "mustn't",
    "should not": "shouldn't",
    "will": "'ll",
}
ALIKE = {
    letter: [
        one["c"]
        for shown in (letter, letter.upper())
        for one in confusables_data.get(shown, ())
        if len(one["c"]) == 1 and one["c"].isalnum() and fold(one["c"]) in (letter, "1")
    ]
    for letter in "abcdefghjkmnopqrstuvwxyz"
}
ALIKE["o"].append("0")
DIGITS = {"i": "1", "l": "1"}


@st.composite
def written(draw, row):
    """A row as people, keyboards and recognisers write it."""
    ends = ["", "ing", "aś", "o"] if row.endswith("*") else [""]
    text = row.removesuffix("*") + draw(st.sampled_from(ends))
    for whole, short in SHORT.items():
        if f" {whole} " in f" {text} " and short[0] != "'" and draw(st.booleans()):
            sign = draw(st.sampled_from([*APOSTROPHES, "", " "]))
            text = text.replace(whole, short.replace("'", sign))
    at = draw(st.integers(0, len(text) - 1))
    sign = text[at]
    ways = ["capitals", "invisible", "alike", "digit", "repeated", "plain", "accents"]
    how = draw(st.sampled_from(ways))
    if how == "capitals":
        text = text.upper()
    elif how == "invisible":
        text = text[:at] + draw(st.sampled_from(INVISIBLE)) + text[at:]
    # "off", "too" are others
    elif how == "repeated" and sign.isalpha() and not {"of", "to"} & set(text.split()):
        text = text[:at] + sign * draw(st.integers(2, 9)) + text[at + 1 :]
    elif how == "alike" and ALIKE.get(sign):
        text = text[:at] + draw(st.sampled_from(ALIKE[sign])) + text[at + 1 :]
    elif how == "digit" and sign in DIGITS and _inside(text, at):
        text = text[:at] + DIGITS[sign] + text[at + 1 :]
    elif how == "accents":
        text = fold(text)
    return text


def _inside(text, at):
    """Whether a letter stands in a word that has others: a 1 alone is a number."""
    return f" {text} "[at] != " " or f" {text} "[at + 2] != " "


def test_every_row_stops_as_it_stands():
    """Each row counts."""
    rows = [row for some in ROWS_OF.values() for row in some]
    assert [row for row in rows if not stop_words(row.removesuffix("*"))] == []


def test_every_row_stops_beside_a_wish():
    """As an own part, and with more words behind it: no aside takes a whole row with it."""
    ways = [
        f"take the jar, {row.removesuffix('*')}{after}"
        for row in ROWS_OF["anywhere"]
        for after in ("", " the bowl", "!", " in a minute")
    ]
    assert [one for one in ways if not stop_words(one)] == []


@settings(max_examples=400, deadline=None)
@given(
    row=st.sampled_from(ROWS_OF["anywhere"]),
    data=st.data(),
    before=st.sampled_from(["", "take the jar, ", "please ", "słoik ", "… "]),
    after=st.sampled_from(["", " the bowl", "!", " in a minute"]),
)
def test_every_row_stops_wherever_it_stands(row, data, before, after):
    """In every form of its letters; none is hidden by how sentences are read."""
    sentence = before + data.draw(written(row)) + after
    assert stop_words(sentence), sentence


@settings(max_examples=200, deadline=None)
@given(
    row=st.sampled_from(ROWS_OF["opening"]),
    data=st.data(),
    before=st.sampled_from(["", *FILLERS]),
    after=st.sampled_from(["", " the jar", ", take the bowl", "!"]),
)
def test_every_opening_stops_at_the_beginning(row, data, before, after):
    """Alone, before something else, and behind fillers."""
    sentence = f"{before} {data.draw(written(row))}{after}"
    assert stop_words(sentence), sentence


@settings(max_examples=200, deadline=None)
@given(
    row=st.sampled_from(ROWS_OF["alone"] + ROWS_OF["answer"]),
    data=st.data(),
    before=st.sampled_from(["", *FILLERS]),
    # an answer
    after=st.sampled_from(["", *(one for one in FILLERS if one not in ("thank you", "dziękuję"))]),
)
def test_every_whole_sentence_stops_between_fillers(row, data, before, after):
    """Nothing else is said."""
    sentence = f"{before} {data.draw(written(row))}! {after}"
    assert stop_words(sentence), sentence


IDIOMS = sorted({form for one in ROWS.harmless for form in forms(f"{one.en},{one.pl}")})
BEHIND = [row.removesuffix("*") for row in ROWS_OF["anywhere"]]


@settings(max_examples=400, deadline=None)
@given(
    idiom=st.sampled_from(IDIOMS),
    row=st.sampled_from(BEHIND),
    mark=st.sampled_from([". ", "! ", ", ", "; ", " - ", "? "]),
    first=st.booleans(),
)
def test_what_is_said_beside_an_idiom_stops(idiom, row, mark, first):
    """Behind it or before it: an idiom takes nothing with it but its own words."""
    sentence = f"{idiom}{mark}{row}" if first else f"{row}{mark}{idiom}"
    assert stop_words(sentence), sentence


def test_a_mark_within_an_idiom_ends_it():
    """\"Don't! Forget it\": what stands before the mark stops as if nothing followed."""
    ways = [
        f"{' '.join(words[:at])}{mark}{' '.join(words[at:])}"
        for words in map(str.split, IDIOMS)
        for at in range(1, len(words))
        for mark in ("! ", ". ", ", ", " - ")
        if stop_words(f"x {' '.join(words[:at])} x")
    ]
    assert len(ways) > 100
    assert [one for one in ways if not stop_words(one)] == []


def test_every_group_has_a_reason_and_no_row_is_there_twice():
    """A row that stands in two groups has two reasons, one of which is wrong."""
    assert all(one.reason.endswith(".") for one in (*ROWS.stop, *ROWS.harmless))
    rows = [
        form for one in ROWS.stop if one.where == "anywhere" for form in forms(f"{one.en},{one.pl}")
    ]
    assert sorted(row for row in set(rows) if rows.count(row) > 1) == []


# --- answers, calls for help ----------------------------------------------------------------------


def test_an_answer_of_a_question_stops_nothing():
    """As it was offered, in any case; every other word stops while a question is open, too."""
    offered = ("jar", "słoik", "no", "nie")
    for answer in ("no", "No.", "nie", "Nie!", "NIE", "jar"):
        assert stop_words(answer, offered) == ""
        assert may_answer(answer) == (fold(answer)[:2] in ("no", "ni"))
    for other in ("stop", "no no", "nie bierz", "no, stop", "nie teraz", "stój"):
        assert stop_words(other, offered)
        assert not may_answer(other)


CALLS = {
    "help": "en",
    "Help me!": "en",
    "help, I've fallen": "en",
    "pomocy!": "pl",
    "pomoc": "pl",
    "pomóż mi": "pl",
}
NO_CALLS = ("stop", "how can you help me", "w czym możesz mi pomóc", "co umiesz", "take the jar")


def test_a_call_for_help_has_a_language():
    """In which it is told what can be said; a question of that is a question."""
    assert {one: calls_for_help(one) for one in CALLS} == CALLS
    assert all(stop_words(one) for one in CALLS)
    assert [one for one in NO_CALLS if calls_for_help(one)] == []


# --- any text -------------------------------------------------------------------------------------


@given(st.text(max_size=300))
def test_whatever_is_said_is_looked_through(sentence):
    """Total."""
    assert isinstance(stop_words(sentence), str)


LONG = ("a" * 10**6, "no " * 10**6, "do not " * 10**6, "ﷺ" * LONGEST, "x" * LONGEST + " stop",
        "a b " * LONGEST,
        "in one minute " * LONGEST, "please " * LONGEST, "st0p1 " * LONGEST,
        "( " * LONGEST, "never mind! " * LONGEST, "in a second. a, " * 49)  # fmt: skip


def test_the_longest_sentence_takes_no_time():
    """It is looked through in the thread that listens to people. The bound is an estimate: it takes
    some ms.
    """
    for sentence in LONG:
        begun = time.process_time()
        stop_words(sentence)
        assert time.process_time() - begun < 0.5, sentence[:20]


# --- One form of a text's letters: whatever a keyboard or a recogniser wrote, a word is the same
# word


FORMS = [
    ("STOP", "stop"),
    ("Żółć, łaźnia, źdźbło, mąkę, cień", "zolc, laznia, zdzblo, make, cien"),
    ("ＳＴＯＰ 𝐬𝐭𝐨𝐩 Ⓢⓣⓞⓟ 🅂🅃🄾🄿 ꜱᴛᴏᴘ 🇸🇹🇴🇵", "stop stop stop stop stop stop"),
    ("ѕтор НОРЕ ΗΟΡΕ", "stop hope hope"),
    ("s\u200bt\u00ado\ufeffp\u202e s\u0336t\u034fop\ufe0f\u20e3 st\x00op", "stop stop stop"),
    ("don’t donʼt don＇t don´t don`t don′t", "don't don't don't don't don't don't"),
    ("take\u00a0the\u2003jar\n", "take the jar "),
    ("🛑 ✋🏽 ⚠️", "🛑 ✋🏽 ⚠"),
    ("ӏ Ι І ｌ", "1 1 1 l"),
]


def test_forms_of_a_text_are_one():
    """Case, accents, widths, alphabets, invisible characters, apostrophes."""
    assert [(text, fold(text)) for text, _ in FORMS] == FORMS


def test_what_looks_like_a_letter_is_read_as_it():
    """Or as a digit that looks like it; but for signs that are something else by their names."""
    others, wrong = {"ſ": "s", "ʋ": "v", "ᶌ": "v", "ͺ": " "}, []
    for letter in string.ascii_lowercase:
        same = {letter, *({"0"} if letter == "o" else {"1", "i", "l"} if letter in "il" else ())}
        rows = (row for one in (letter, letter.upper()) for row in confusables_data.get(one, ()))
        alike = (row["c"] for row in rows)
        for one in alike:
            if (
                len(one) == 1
                and one.isalnum()
                and not one.isascii()
                and fold(one) not in same | {others.get(one)}
            ):
                wrong.append(f"{one} {unicodedata.name(one)}")
    assert wrong == []


def test_apostrophes_are_those_of_unicode():
    """Every sign that its table calls confusable with one."""
    letters = ((one, rows) for one, rows in confusables_data.items() if len(one) == 1)
    signs = {one for one, rows in letters if any(row["c"] == "'" for row in rows)}
    assert set(APOSTROPHES) == signs | {"'"}


@given(st.text())
def test_any_text_has_a_form_which_is_its_own_form(text):
    """Total, and idempotent."""
    assert fold(fold(text)) == fold(text)


def test_the_form_of_every_sign_is_its_own_form():
    """Of the plane in which people write; a random text seldom has the sign that fails."""
    signs = [chr(one) for one in range(0x10000) if not 0xD800 <= one < 0xE000]
    assert [one for one in signs if fold(fold(one)) != fold(one)] == []


def test_the_table_is_loaded_by_a_letter_of_another_alphabet_alone():
    """Polish, quotation marks and emoji do not cost its memory and time; agents at rest have none
    of it.
    """
    program = (
        "import sys; from companion.stop_words import fold; fold('„Weź słoik”… don’t 🛑');"
        "before = 'confusable_homoglyphs' in sys.modules; fold('ѕтор');"
        "print(before, 'confusable_homoglyphs' in sys.modules)"
    )
    command, how = [sys.executable, "-c", program], {"timeout": 30, "check": True}
    done = subprocess.run(command, capture_output=True, text=True, **how)
    assert done.stdout.split() == ["False", "True"]
