"""What ROS is told, served to Foxglove over WebSockets: the same messages in CDR, and scenes and a
log in Foxglove's own types.

Nothing comes in: the server offers viewers neither topics, nor parameters, nor services. It has no
password: whoever knows its address on this machine sees what it tells (docs/threats.md). Must not
know: where messages come from.
"""

import threading
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from typing import Any, NamedTuple

import foxglove
from foxglove import messages as own
from foxglove.websocket import ChannelView, Client, ServerListener

from operate.ros.messages import (
    COMMUNICATE,
    CUBE,
    CYLINDER,
    DELETE_ALL,
    LOG,
    LOG_LEVELS,
    MARKER,
    MARKERS,
    SPHERE,
    SPHERES,
    TRIANGLES,
    Entry,
    Topic,
    definition,
    encoded,
    nanoseconds,
)
from operate.verdict_lines import LEVELS
from operate.wording import bytes_in_words
from topdown.judge.verdicts import Verdict

OWN = "/foxglove"
"""Begins the topics in Foxglove's own types."""
BACKLOG = 1024
"""Messages that wait for a viewer, which then loses the oldest; the default of the library."""


class Foxglove(ServerListener):
    """A server, whose work is done by threads of Foxglove's library.

    `url`: where viewers connect; `page`: an address that opens Foxglove there.
    """

    def __init__(self, name: str, host: str, port: int) -> None:
        """`port` 0: a free one. Raise RuntimeError where it cannot be opened."""
        self._context = foxglove.Context()
        self._channels: dict[str, foxglove.Channel] = {}
        self._latched: dict[str, Entry] = {}
        self._lock, self._asked = threading.Lock(), set[str]()
        self._server = foxglove.start_server(
            name=name,
            host=host,
            port=port,
            capabilities=[],
            server_listener=self,
            context=self._context,
            message_backlog_size=BACKLOG,
        )
        self.url = f"ws://{host}:{self._server.port}"
        self.page = self._server.app_url() or ""

    def on_subscribe(self, client: Client, channel: ChannelView) -> None:
        """A viewer wants a topic; from a thread of the library."""
        with self._lock:
            self._asked.add(channel.topic)

    def offer(self, topics: Iterable[Topic]) -> None:
        """Advertise topics: a viewer gets what is told on them after it has asked for them."""
        for one in topics:
            for form in _forms(Entry(0.0, one.name, one.kind, None)):
                self._channel(form)

    def tell(self, entry: Entry) -> None:
        """Tell the viewers; what nobody looks at is not encoded."""
        for form in _forms(entry):
            self._log(form, entry.at)
        if entry.latched:
            self._latched[entry.topic] = entry

    def answer(self) -> None:
        """Tell what is latched on topics that viewers came to since the last time; the others get
        it again.
        """
        with self._lock:
            asked, self._asked = self._asked, set()
        for entry in self._latched.values() if asked else ():
            for form in _forms(entry):
                if form.topic in asked:
                    self._log(form, entry.at)

    def close(self) -> None:
        """End the server."""
        self._server.stop()

    def _log(self, form: "_Form", at: float) -> None:
        channel = self._channel(form)
        if channel.has_sinks():
            channel.log(form.encoded(), log_time=nanoseconds(at))

    def _channel(self, form: "_Form") -> foxglove.Channel:
        if form.topic not in self._channels:
            self._channels[form.topic] = foxglove.Channel(
                form.topic,
                message_encoding=form.encoding,
                schema=form.schema(),
                context=self._context,
            )
        return self._channels[form.topic]


class _Form(NamedTuple):
    """How an entry is told on a topic."""

    topic: str
    encoding: str
    schema: Callable[[], foxglove.Schema]
    encoded: Callable[[], bytes]


def _forms(entry: Entry) -> Iterator[_Form]:
    yield _Form(entry.topic, "cdr", partial(_schema, entry.kind), partial(encoded, entry))
    if entry.kind in (MARKER, MARKERS):
        scene = partial(_scene, entry)
        yield _Form(OWN + entry.topic, "protobuf", own.SceneUpdate.get_schema, scene)
    elif entry.kind in (LOG, COMMUNICATE):
        yield _Form(f"{OWN}/log", "protobuf", own.Log.get_schema, partial(_line, entry))


def _schema(kind: str) -> foxglove.Schema:
    return foxglove.Schema(name=kind, encoding="ros2msg", data=definition(kind).encode())


# --- Foxglove's own types -------------------------------------------------------------------------


def _line(entry: Entry) -> bytes:
    """A line of a log; of a communicate with a level by its verdict, as far as it is known."""
    one = entry.message
    if entry.kind == LOG:
        name, text, level = one.name, one.msg, _LOGGED.get(one.level, own.LogLevel.Fatal)
    else:
        verdict = Verdict(one.verdict) if one.verdict else Verdict.LEGAL
        name, level = one.channel, _SAID[LEVELS.get(verdict, "ERROR")]
        text = f"{one.sender} > {one.receiver}  {one.performative}  {one.text}"
        why = f"  {one.verdict}: {one.why}" if one.why else ""
        text += f"  ({bytes_in_words(one.size)}){why}"
    return own.Log(timestamp=_time(entry.at), level=level, message=text, name=name).encode()


_SAID = {
    "DEBUG": own.LogLevel.Debug,
    "INFO": own.LogLevel.Info,
    "WARN": own.LogLevel.Warning,
    "ERROR": own.LogLevel.Error,
}
_LOGGED = dict(zip(LOG_LEVELS.values(), _SAID.values(), strict=True))


def _scene(entry: Entry) -> bytes:
    """Markers as entities of a scene, each in its frame."""
    markers = entry.message.markers if entry.kind == MARKERS else [entry.message]
    gone = [one for one in markers if one.action == DELETE_ALL]
    every = own.SceneEntityDeletion(timestamp=_time(entry.at), type=own.SceneEntityDeletionType.All)
    entities = [_entity(one, entry.at) for one in markers if one.action != DELETE_ALL]
    return own.SceneUpdate(deletions=[every] if gone else [], entities=entities).encode()


def _entity(one: Any, at: float) -> own.SceneEntity:
    return own.SceneEntity(
        timestamp=_time(at),
        frame_id=one.header.frame_id,
        id=f"{one.ns}/{one.id}",
        frame_locked=one.frame_locked,
        **_SHAPES.get(one.type, lambda _: {})(one),
    )


def _time(at: float) -> own.Timestamp:
    return own.Timestamp(*divmod(nanoseconds(at), 1_000_000_000))


def _looks(one: Any) -> dict[str, Any]:
    """Where it is in its frame, how large, and of which colour."""
    at, turn = one.pose.position, one.pose.orientation
    return {
        "pose": own.Pose(
            position=own.Vector3(x=at.x, y=at.y, z=at.z),
            orientation=own.Quaternion(x=turn.x, y=turn.y, z=turn.z, w=turn.w),
        ),
        "size": own.Vector3(x=one.scale.x, y=one.scale.y, z=one.scale.z),
        "color": own.Color(r=one.color.r, g=one.color.g, b=one.color.b, a=one.color.a),
    }


def _at(point: Any) -> own.Pose:
    """A point of a marker whose own pose is that of its frame."""
    return own.Pose(position=own.Vector3(x=point.x, y=point.y, z=point.z))


_SHAPES: dict[int, Callable[[Any], dict[str, Any]]] = {
    CUBE: lambda one: {"cubes": [own.CubePrimitive(**_looks(one))]},
    SPHERE: lambda one: {"spheres": [own.SpherePrimitive(**_looks(one))]},
    CYLINDER: lambda one: {
        "cylinders": [own.CylinderPrimitive(**_looks(one), bottom_scale=1.0, top_scale=1.0)]
    },
    SPHERES: lambda one: {
        "spheres": [
            own.SpherePrimitive(**_looks(one) | {"pose": _at(point)}) for point in one.points
        ]
    },
    TRIANGLES: lambda one: {
        "triangles": [
            own.TriangleListPrimitive(
                points=[own.Point3(x=at.x, y=at.y, z=at.z) for at in one.points],
                **{name: look for name, look in _looks(one).items() if name != "size"},
            )
        ]
    },
}
"""By types of markers; one of another type is an entity without a shape."""
