"""One form of a text's letters: whatever a keyboard or a recogniser wrote, a word is the same
word.
"""

import string
import subprocess
import sys
import unicodedata

from confusable_homoglyphs.confusables import confusables_data
from hypothesis import given
from hypothesis import strategies as st

from companion.stop_words import APOSTROPHES, fold

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
