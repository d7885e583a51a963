"""Colours and rules of the drawings. Every colour is backed by a dash, a weight or a word, so grey prints read, too.

Plain values instead of CSS variables, since viewers of SVG files other than browsers have none.
"""

from string import Template

FONT = "Helvetica, Arial, 'Liberation Sans', sans-serif"

LIGHT = {
    "paper": "#ffffff",
    "ink": "#1b2530",
    "muted": "#56636f",
    "line": "#7d8a96",
    "fill": "#f1f5f8",
    "dim": "#d5dde4",
    "accent": "#0a5c9e",
    "warm": "#9c4206",
}
DARK = {
    "paper": "#14191f",
    "ink": "#e5eaef",
    "muted": "#a3b0bc",
    "line": "#73808c",
    "fill": "#1f2831",
    "dim": "#3a4651",
    "accent": "#74b8f4",
    "warm": "#f2a766",
}

_DRAWING = Template("""
.drawing .ground{fill:$paper}
.drawing text{fill:$ink}
.drawing .quiet{fill:$muted}
.drawing .marked{fill:$accent}
.drawing .alert{fill:$warm}
.drawing .box{fill:$fill;stroke:$line}
.drawing .gone{fill:$dim;stroke:$line}
.drawing .fresh{fill:$fill;stroke:$accent;stroke-width:2.5}
.drawing .group{fill:$fill;stroke:$ink;stroke-dasharray:6 3}
.drawing .inner{fill:$paper;stroke:$line}
.drawing .patch{fill:$paper}
.drawing .frame{fill:none;stroke:$line}
.drawing .tab{fill:$dim;stroke:$line}
.drawing .dot{fill:$ink;stroke:$ink}
.drawing .port{fill:$paper;stroke:$accent}
.drawing .port.full{fill:$accent}
.drawing text.knock{fill:$paper}
.drawing .edge{fill:none;stroke:$ink;stroke-width:1.4}
.drawing .thin{fill:none;stroke:$line}
.drawing .life{fill:none;stroke:$line;stroke-dasharray:4 4}
.drawing .channel{fill:none;stroke:$accent;stroke-width:1.8}
.drawing .channel.dashed{stroke-dasharray:7 4}
.drawing .new{stroke-width:3}
.drawing .head{fill:$ink}
.drawing .channelhead{fill:$accent}
""")

_PAGE = Template("""
body{background:$paper;color:$ink}
a{color:$accent}
h1,h2,h3,nav{border-color:$dim}
caption,figcaption,.note,.lead,nav b,footer{color:$muted}
th,td{border-color:$dim}
thead th{color:$muted}
tbody tr:hover td,tbody tr:hover th{background:$fill}
code,details{background:$fill}
figure{border-color:$dim}
""")

SHAPES = f""".drawing text{{font-family:{FONT};font-size:13px}}
.drawing .strong{{font-weight:bold}}
.drawing .small{{font-size:11px}}
.drawing .large{{font-size:15px}}
"""

LAYOUT = f"""html{{font:15px/1.5 {FONT}}}
body{{margin:0 auto;max-width:1180px;padding:0 20px 60px}}
h1{{margin:32px 0 4px;font-size:28px}}
h2{{margin:48px 0 8px;padding-top:14px;border-top:2px solid;font-size:21px}}
h3{{margin:26px 0 6px;font-size:16px}}
p{{margin:6px 0;max-width:80ch}}
nav{{margin:20px 0;padding:12px 0;border-top:1px solid;border-bottom:1px solid;columns:3 240px}}
nav div{{break-inside:avoid;margin:0 0 10px}}
nav b,nav a{{display:block}}
.wide{{overflow-x:auto;margin:10px 0}}
table{{border-collapse:collapse;font-size:14px}}
caption{{text-align:left;padding:4px 0;font-weight:bold}}
th,td{{text-align:left;vertical-align:top;padding:4px 18px 4px 0;border-bottom:1px solid}}
thead th{{font-size:12px;white-space:nowrap}}
tbody th{{white-space:nowrap}}
td{{min-width:3em;max-width:52ch;overflow-wrap:anywhere}}
figure{{width:fit-content;max-width:100%;box-sizing:border-box;margin:14px 0;padding:12px;
border:1px solid;border-radius:6px;overflow-x:auto}}
figure svg{{display:block;max-width:100%;height:auto}}
.pair{{display:flex;flex-wrap:wrap;gap:0 32px;align-items:flex-start;margin:18px 0 30px}}
.pair>div{{flex:0 1 auto;min-width:0;max-width:100%}}
.pair td{{max-width:38ch}}
.pair p{{max-width:58ch}}
figcaption{{padding:0 0 8px;font-size:14px}}
.note{{font-size:13px}}
details{{margin:8px 0;padding:6px 12px;border-radius:6px;font-size:14px}}
summary{{cursor:pointer}}
footer{{margin-top:60px;font-size:13px}}
"""

PRINT = """@media print{
html{font-size:11px}
body{max-width:none;padding:0}
h2{break-after:avoid}
h3,caption,figcaption{break-after:avoid}
figure,tr{break-inside:avoid}
figure{overflow:visible;border:0;padding:0}
.wide{overflow:visible}
figure svg{max-height:23cm;width:auto;min-width:0!important}
.pair figure svg{max-height:8cm}
nav a{text-decoration:none}
}
"""


def drawing_rules() -> str:
    """CSS of a drawing that stands alone."""
    dark = _DRAWING.substitute(DARK)
    return f"{SHAPES}{_DRAWING.substitute(LIGHT).strip()}\n@media (prefers-color-scheme: dark){{{dark}}}\n"


def page_rules() -> str:
    """CSS of the page and of all drawings in it; paper is always light."""
    light = (_PAGE.substitute(LIGHT) + _DRAWING.substitute(LIGHT)).strip()
    dark = _PAGE.substitute(DARK) + _DRAWING.substitute(DARK)
    return f"{LAYOUT}{SHAPES}{light}\n@media screen and (prefers-color-scheme: dark){{{dark}}}\n{PRINT}"
