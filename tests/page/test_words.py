"""The page's words: both languages say the same."""

from services.page.view import LANGUAGES, WORDS


def test_both_languages_say_the_same():
    """Each row of a language has its row in the other, with as many blanks."""
    english, polish = ({name: text.count("{") for name, text in WORDS[language].items()} for language in LANGUAGES)
    assert english == polish
