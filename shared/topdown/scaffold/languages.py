"""The modules of a project's content languages: one Struct for each class that the design names, fields to fill in."""

from topdown.model import elements
from topdown.model.design import Design
from topdown.scaffold.naming import WIDTH, classes, docstring, module, sentence, wrapped


def language_files(design: Design, package: str) -> dict[str, str]:
    """Path -> text of the languages' modules."""
    words = classes(design)
    files = {f"{package}/languages/__init__.py": _init(design, package)}
    for language in design.file.language:
        path = f"{package}/languages/{module(language.name)}.py"
        files[path] = _module(design, language, words[language.name])
    return files


def _init(design: Design, package: str) -> str:
    modules = sorted(module(language.name) for language in design.file.language)
    named = [f"{module(entry.name)}.LANGUAGE" for entry in design.file.language]
    return "\n".join(
        (
            '"""The content languages of the design, one module each, and the registry of them by name."""',
            "",
            "from fipa_codec.languages import Languages",
            "",
            f"from {package}.languages import {', '.join(modules)}",
            "",
            wrapped("LANGUAGES = Languages((", named, ",))" if len(named) == 1 else "))"),
            "",
        )
    )


def _module(design: Design, language: elements.Language, words: tuple[str, ...]) -> str:
    said = _uses(design, language.name)
    text = f"{language.name}: {language.text or 'a content language of the design'}.\n\n"
    text += (
        "Give each sentence its fields; msgspec checks them on the way in. Where a protocol tells uses of inform apart "
    )
    text += "(progress, final), give the Language a `kind`: a function of the sentence."
    parts = [
        docstring(text),
        "\nimport msgspec\nfrom fipa_codec.languages import Language\n\n",
        "class Sentence(msgspec.Struct, frozen=True, tag=True, forbid_unknown_fields=True):",
        f'    """Something said in {language.name}."""\n\n',
    ]
    for word in words:
        parts += [f"class {word}(Sentence, frozen=True):", docstring(_about(word, said.get(word, ())), 4), "\n"]
    parts.append(_union(words))
    parts.append(f'LANGUAGE = Language("{language.name}", Content)\n')
    return "\n".join(parts)


def _union(words: tuple[str, ...]) -> str:
    if not words:
        return "Content = Sentence"
    line = " | ".join(words)
    if len(f"Content = {line}") <= WIDTH:
        return f"Content = {line}"
    lines = (line,) if len(f"    {line}") <= WIDTH else (words[0], *(f"| {word}" for word in words[1:]))
    return "\n".join(("Content = (", *(f"    {one}" for one in lines), ")"))


def _uses(design: Design, language: str) -> dict[str, tuple[str, ...]]:
    """Class -> in which acts it is said."""
    found: dict[str, list[str]] = {}
    for use in design.file.protocol:
        for message in use.message:
            for name in design.contents(use, message):
                spoken, _, word = name.partition(".")
                if spoken == language:
                    found.setdefault(word, []).append(f"{message.performative} of {message.sender} in {use.name}")
    return {word: tuple(dict.fromkeys(acts)) for word, acts in found.items()}


def _about(word: str, acts: tuple[str, ...]) -> str:
    return sentence(", ".join(acts), f"{word}: fields to fill in").removesuffix(".") + "."
