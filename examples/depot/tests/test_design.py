"""The design is consistent in itself, and agrees with the languages and the protocols it names."""

from topdown import check
from topdown.check import agreement

from depot.design import DESIGN, LANGUAGES


def test_the_design_is_consistent():
    """No finding; each would say what is wrong and what would be right."""
    assert check.check(DESIGN) == ()


def test_the_languages_have_the_designs_classes():
    """Every class that the design names is there, and every language."""
    names = [entry.name for entry in DESIGN.file.language]
    classes = {name: [kind.__name__ for kind in LANGUAGES.named(name).classes] for name in names}
    assert agreement.check_languages(DESIGN, classes) == ()
