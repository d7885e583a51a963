"""Layouts of systems, trees and state machines: nothing overlaps, nothing is lost, for designs of
any kind.
"""

import re
from itertools import combinations, pairwise
from xml.etree import ElementTree

from hypothesis import given
from hypothesis import strategies as st

from topdown.draw import canvas, decomposition, machines, system
from topdown.draw.canvas import Box, Canvas, tracks
from topdown.model import elements
from topdown.model.design import Design

WORDS = st.text(st.sampled_from("abcdefgh iMW<&>\"'"), max_size=60)


def designed(count: int, joins: list[tuple[int, int]], texts: list[str], agents: int) -> Design:
    """A design of that many groups g0, g1 ..., split off one after the other; the last step makes
    the channels.
    """
    names = [f"g{number}" for number in range(count)]
    rests = ["root", *(f"r{number}" for number in range(1, count - 1)), names[-1]]
    steps = [
        elements.Step(
            requirements=(f"R{number}",),
            divide=elements.Division(rests[number], (names[number], rests[number + 1])),
            tasks=(elements.Task(names[number], texts[number]),),
        )
        for number in range(count - 1)
    ]
    ends = [(names[a], names[b]) for a, b in joins]
    channels = [
        elements.NewChannel(f"C{number}", pair, texts[join[0]])
        for number, (pair, join) in enumerate(zip(ends, joins, strict=True), 1)
    ]
    uses = [
        elements.Protocol(f"p{number}", f"C{number}", "request", *pair, True, ())
        for number, pair in enumerate(ends, 1)
    ]
    wanted = [elements.Requirement(id=f"R{n}", text=texts[n]) for n in range(count)]
    return Design(
        elements.DesignFile(
            system=elements.System(name="any", root="root", key=""),
            requirement=tuple(wanted),
            step=(*steps, elements.Step(requirements=(), channels=tuple(channels))),
            language=(),
            interface=(),
            protocol=tuple(uses),
            agent=tuple(elements.Agent(name=name) for name in names[:agents]),
        )
    )


@st.composite
def designs(draw: st.DrawFn) -> Design:
    """3 to 8 agents (or groups that stay groups), joined in any way."""
    count = draw(st.integers(3, 8))
    pairs = list(combinations(range(count), 2))
    joins = draw(st.lists(st.sampled_from(pairs), unique=True, max_size=12))
    texts = draw(st.lists(WORDS, min_size=count, max_size=count))
    return designed(count, joins, texts, draw(st.integers(0, count)))


@st.composite
def agents(draw: st.DrawFn) -> elements.Agent:
    """Up to 9 states with any arcs between them."""
    names = [f"state{number}" for number in range(draw(st.integers(1, 9)))]
    name = st.sampled_from(names)
    when = st.sampled_from(["", "ready", "something_quite_long_has_happened", "<x & y>"])
    arcs = st.builds(lambda a, b, w: elements.Arc(source=a, target=b, when=w), name, name, when)
    return elements.Agent(
        name="any",
        initial=draw(name),
        state=tuple(
            elements.State(name=n, behaviour=f"do_{n}", terminal="over", error=draw(when))
            for n in names
        ),
        arc=tuple(draw(st.lists(arcs, max_size=16, unique=True))),
    )


def overlapping(boxes: list[Box], gap: float = 0.0) -> list[tuple[Box, Box]]:
    """Pairs that overlap, or come nearer than the gap."""
    return [(a, b) for a, b in combinations(boxes, 2) if a.meets(b, gap)]


def inside(canvas: Canvas) -> bool:
    """Whether all words and boxes are in the picture."""
    frame = canvas.frame
    return all(
        frame.x <= b.x and b.right <= frame.right and frame.y <= b.y and b.bottom <= frame.bottom
        for b in (*canvas.labels, *canvas.boxes)
    )


def lines(canvas: Canvas, css: str) -> list[list[tuple[float, ...]]]:
    """The points of the lines of a class, read from the SVG."""
    return [
        [tuple(map(float, point.split(","))) for point in element.get("points", "").split()]
        for element in ElementTree.fromstring(canvas.svg()).iter()
        if element.tag.endswith("polyline") and css in element.get("class", "").split()
    ]


def drawn(canvas: Canvas, css: str, gap: float) -> list[list[tuple[float, ...]]]:
    """The lines of a class, in a picture in which boxes are apart and no line passes one."""
    found = lines(canvas, css)
    assert not overlapping(canvas.boxes, gap)
    assert inside(canvas)
    assert not [line for line in found for box in canvas.boxes if through(line, box)]
    return found


def through(line: list[tuple[float, ...]], box: Box) -> bool:
    """Whether a line comes more than 2 px into a box: what is left of it between the box's
    edges.
    """
    for (x0, y0), (x1, y1) in pairwise(line):
        first, last = 0.0, 1.0
        for start, way, low, high in (
            (x0, x1 - x0, box.x, box.right),
            (y0, y1 - y0, box.y, box.bottom),
        ):
            if way:
                ends = sorted(((low + 2 - start) / way, (high - 2 - start) / way))
                first, last = max(first, ends[0]), min(last, ends[1])
            elif not low + 2 < start < high - 2:
                last = -1.0
        if first < last:
            return True
    return False


@given(designs())
def test_agents_of_a_system_do_not_overlap(design: Design) -> None:
    """Boxes and words are apart and in the picture; a channel is one line with its name, and passes
    no box.
    """
    canvas = system.draw(design)
    assert len(canvas.boxes) == len(design.decomposition.last.groups)
    assert len(drawn(canvas, "channel", 20)) == len(design.channels)
    assert all(f">{name}<" in canvas.svg() for name in design.channels)
    assert not overlapping(canvas.labels)


@given(designs(), st.data())
def test_a_tree_shows_every_group_and_channel_of_its_step(
    design: Design, data: st.DataObject
) -> None:
    """Divided groups and the fringe are boxes apart from each other; the channels of the step are
    there.
    """
    step = data.draw(st.integers(0, len(design.file.step)))
    stage = design.decomposition.stages[step]
    canvas = decomposition.draw(design, step)
    divided = sum(entry.divide is not None for entry in design.file.step[:step])
    assert len(canvas.boxes) == divided + len(stage.groups)
    assert len(drawn(canvas, "channel", 4)) == len(stage.channels)


@given(agents())
def test_a_machine_shows_every_state_and_arc(agent: elements.Agent) -> None:
    """States are boxes apart from each other, each arc is one line that passes no state; words do
    not overlap.
    """
    canvas = machines.draw(agent)
    assert len(canvas.boxes) == len(agent.state)
    found = drawn(canvas, "edge", 10)
    assert len(found) == len(agent.arc) + 1  # and the one to the initial state
    assert not overlapping(canvas.labels)
    # no two upright parts of arcs share a place
    upright = [(a, b) for line in found for a, b in pairwise(line) if a[0] == b[0] and a[1] != b[1]]
    spans = [(a[0], *sorted((a[1], b[1]))) for a, b in upright]
    assert not [
        (s, t) for s, t in combinations(spans, 2) if s[0] == t[0] and s[1] < t[2] and t[1] < s[2]
    ]


def test_channels_between_neighbours_stay_short() -> None:
    """Six agents in a ring of four with two tails need no line that crosses another or goes
    around.
    """
    pairs = [("co", "ta"), ("co", "hi"), ("co", "pl"), ("pl", "km"), ("ex", "ta"), ("ta", "km")]
    cells = canvas.placed(["hi", "co", "pl", "km", "ex", "ta"], pairs)
    assert cells["hi"] == (0, 0)
    assert all(
        sum(abs(i - j) for i, j in zip(cells[a], cells[b], strict=True)) == 1 for a, b in pairs
    )


def test_an_agent_with_many_channels_is_wide_enough() -> None:
    """A star of fourteen: buffers and labels stand apart."""
    canvas = system.draw(designed(14, [(0, other) for other in range(1, 14)], ["x"] * 14, 14))
    assert not overlapping(canvas.labels)
    assert not overlapping(canvas.boxes, 20)
    hub = max(canvas.boxes, key=lambda box: box.width)
    assert hub.width >= 7 * system.PAIR


def test_crossings_are_avoided() -> None:
    """Three pairs in two rows."""
    pairs = [("a", "f"), ("b", "e"), ("c", "d")]
    cells = canvas.placed(list("abcdef"), pairs)
    across = [sorted((cells[a], cells[b])) for a, b in pairs]
    columns = [(one[1], other[1]) for one, other in across if one[0] != other[0]]
    assert not [1 for (a, b), (c, d) in combinations(columns, 2) if (a - c) * (b - d) < 0]


@given(st.lists(st.tuples(st.integers(0, 100), st.integers(0, 100))))
def test_spans_of_one_track_are_apart(spans: list[tuple[int, int]]) -> None:
    """Spans on the same track keep their distance."""
    found = tracks(spans, 8)
    ordered = [tuple(sorted(span)) for span in spans]
    for i, j in combinations(range(len(spans)), 2):
        if found[i] == found[j]:
            assert ordered[i][1] + 8 <= ordered[j][0] or ordered[j][1] + 8 <= ordered[i][0]


def test_names_are_escaped() -> None:
    """Text that looks like markup is shown as it is written, also in an attribute."""
    evil = designed(3, [(0, 1)], ["</text><script>\"&'", "b", "c"], 3)
    tree = decomposition.requirements_section(evil, 80).parts[0].canvas  # type: ignore[union-attr]
    for picture in (system.draw(evil), decomposition.draw(evil, 2), tree):
        root = ElementTree.fromstring(picture.svg())
        assert not [element for element in root.iter() if element.tag.endswith("script")]
        assert "<script>" in "".join(root.itertext())
    assert ElementTree.fromstring(Canvas('a "b" <c>&').svg()).get("aria-label") == 'a "b" <c>&'


@given(designs())
def test_every_requirement_is_in_the_tree_once(design: Design) -> None:
    """In the order of the tree, with the steps that handle it; what no step handles is told so."""
    found = decomposition.covered(design)
    assert sorted(c.id for c in found) == sorted(entry.id for entry in design.file.requirement)
    assert found[-1].by == "no step handles it"
    assert all(re.match(r"step \d+", c.by) for c in found[:-1])
