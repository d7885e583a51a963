"""One self-contained HTML page of all sections: no scripts, nothing fetched, light and dark, fit for paper."""

from html import escape

from topdown.draw import style
from topdown.draw.document import Figure, Grid, Section


def page(title: str, lead: str, sections: tuple[Section, ...]) -> str:
    """The page; the same sections give the same bytes."""
    body = "".join(_section(section) for section in sections)
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        '<meta name="color-scheme" content="light dark">\n'
        f"<title>{escape(title)}</title>\n<style>\n{style.page_rules()}</style>\n</head>\n<body>\n"
        f'<h1>{escape(title)}</h1>\n<p class="lead">{escape(lead)}</p>\n{_contents(sections)}{body}'
        "<footer>Derived from the design file; change that, not this page.</footer>\n</body>\n</html>\n"
    )


def _contents(sections: tuple[Section, ...]) -> str:
    """Links to all sections and to the figures in them."""
    blocks = []
    for section in sections:
        figures = [part for part in section.parts if isinstance(part, Figure)]
        links = "".join(f'<a href="#{_name(f.name)}">{escape(_short(f.caption))}</a>' for f in figures)
        links = links if len(figures) > 1 else ""
        blocks.append(f'<div><a href="#{section.what}"><strong>{escape(section.title)}</strong></a>{links}</div>')
    return f"<nav>{''.join(blocks)}</nav>\n"


def _short(caption: str) -> str:
    return caption.split(":")[0]


def _name(name: str) -> str:
    """A name as it may stand in an address."""
    return "figure-" + "".join(c if c.isascii() and (c.isalnum() or c in "-_") else f"-{ord(c):x}-" for c in name)


def _section(section: Section) -> str:
    blocks = [_part(part) for part in section.parts]
    if section.paired:
        blocks = [
            f'<div class="pair"><div>{a}</div><div>{b}</div></div>\n' for a, b in zip(*[iter(blocks)] * 2, strict=True)
        ]
    parts = "".join(blocks)
    head = f'<h2 id="{section.what}">{escape(section.title)}</h2>\n<p class="lead">{escape(section.lead)}</p>\n'
    return f"<section>\n{head}{parts}</section>\n"


def _part(part: Grid | Figure) -> str:
    notes = "".join(f'<p class="note">{escape(note)}</p>\n' for note in part.notes)
    if isinstance(part, Figure):
        caption = f"<figcaption>{escape(part.caption)}</figcaption>"
        return f'<figure id="{_name(part.name)}">{caption}\n{part.canvas.svg(alone=False)}</figure>\n{notes}'
    if part.folded or part.detail:
        table = _table(part, titled=False)
        return f"<details><summary>{escape(part.title)}</summary>\n{table}{notes}</details>\n"
    return _table(part, titled=True) + notes


def _table(grid: Grid, titled: bool) -> str:
    caption = f"<caption>{escape(grid.title)}</caption>\n" if titled and grid.title else ""
    head = "".join(f"<th>{escape(cell)}</th>" for cell in grid.head)
    head = f"<thead><tr>{head}</tr></thead>\n" if any(grid.head) else ""
    rows = "".join(_row(row) for row in grid.rows)
    return f'<div class="wide"><table>\n{caption}{head}<tbody>\n{rows}</tbody></table></div>\n'


def _row(row: tuple[str, ...]) -> str:
    first, *rest = row
    cells = "".join(f"<td>{escape(cell)}</td>" for cell in rest)
    return f'<tr><th scope="row">{escape(first)}</th>{cells}</tr>\n'
