"""Does a design agree with the code that carries it out: languages' classes, kinds of queries?

The paper's specification "lets one check that every query kind is supported and that arguments and
answers comply" (section 5.6). The code's side comes in as arguments, so nothing of a particular
system is imported here.
"""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping

from topdown.model.design import Design
from topdown.model.findings import Finding, Kind


def check_languages(design: Design, classes: Mapping[str, Iterable[str]]) -> tuple[Finding, ...]:
    """Findings between the design and the languages: name -> names of its classes."""
    return tuple(_languages(design, {name: frozenset(found) for name, found in classes.items()}))


def _languages(design: Design, known: Mapping[str, frozenset[str]]) -> Iterator[Finding]:
    declared = sorted(language.name for language in design.file.language)
    for name in sorted(set(declared) - known.keys()):
        right = f"languages with one are {', '.join(sorted(known))}"
        yield Finding(Kind.CODE, f"language {name}", "has no module", right)
    for name in sorted(known.keys() - set(declared)):
        wrong = "is not in the design"
        yield Finding(Kind.CODE, f"language {name}", wrong, f"the design has {', '.join(declared)}")
    for interface in design.file.interface:
        for entry in interface.entries:
            for name in (*entry.arguments, *entry.answers):
                yield from _class(f"interface {interface.name}, {entry.name}", name, known)
    for use, _ in design.written:
        for message in use.message:
            where = f"protocol {use.name}, {message.sender} {message.performative}"
            for name in (name for name in message.content if not name.startswith("*")):
                yield from _class(where, f"{message.language}.{name}", known)
    yield from _unsaid_classes(design, known)


def check_queries(
    design: Design, interfaces: Iterable[str], language: str, kinds: Iterable[str]
) -> tuple[Finding, ...]:
    """Findings between the argument classes of interface sets and the query classes a language has:
    neither may lack one.
    """
    entries = [entry for name in interfaces for entry in design.interfaces[name].entries]
    declared = Counter(argument for entry in entries for argument in entry.arguments)
    wanted = frozenset(f"{language}.{kind}" for kind in kinds)
    foreign = f"{language} has no such query class"
    wrong, right = "several interface entries ask it", "one entry for each query class"
    found = [_not_asked(name) for name in sorted(wanted - declared.keys())]
    for name in sorted(declared.keys() - wanted):
        drop = "define the class or drop the entry"
        found.append(Finding(Kind.NOT_SUPPORTED, name, foreign, drop))
    several = sorted(name for name, count in declared.items() if count > 1)
    return (*found, *(Finding(Kind.TWICE, name, wrong, right) for name in several))


def check_supported(design: Design, agent: str, kinds: Iterable[str]) -> tuple[Finding, ...]:
    """Findings between what agents may ask `agent` (argument classes of the interfaces in which it
    answers) and the kinds its code answers, written LANGUAGE.Class: a declared kind without code,
    code that nobody can ask.
    """
    uses = [use for use in design.file.protocol if use.participant == agent]
    entries = (entry for use in uses for entry in design.entries(use.name))
    offered, supported = {name for entry in entries for name in entry.arguments}, frozenset(kinds)
    found = []
    for name in sorted(offered - supported):
        where, wrong = f"agent {agent}, {name}", "is declared, and no code answers it"
        found.append(Finding(Kind.NOT_SUPPORTED, where, wrong, "answer it"))
    return (*found, *(_not_asked(name) for name in sorted(supported - offered)))


def _not_asked(name: str) -> Finding:
    right = "declare it in an interface of the design"
    return Finding(Kind.NOT_ASKED, name, "no interface entry asks it", right)


def _class(where: str, name: str, known: Mapping[str, frozenset[str]]) -> Iterator[Finding]:
    language, _, word = name.partition(".")
    if word not in known.get(language, frozenset()):
        ways = ", ".join(sorted(known.get(language, frozenset()))) or f"no language {language!r}"
        wrong = f"{language!r} has no class {word!r}"
        yield Finding(Kind.CODE, where, wrong, f"its classes are {ways}")


def _unsaid_classes(design: Design, known: Mapping[str, frozenset[str]]) -> Iterator[Finding]:
    """Classes of the languages that no message of the design carries."""
    messages = ((use, message) for use, _ in design.written for message in use.message)
    said = {name for use, message in messages for name in design.contents(use, message)}
    for language in sorted(entry.name for entry in design.file.language):
        for word in sorted(known.get(language, frozenset())):
            if f"{language}.{word}" not in said:
                right = (
                    "list it as content of a message or in an entry of an interface, or drop the"
                    " class"
                )
                where = f"language {language}"
                yield Finding(Kind.UNUSED, where, f"no message carries {word}", right)
