"""Messages of ROS 2 by the names of their types, and one of our own for a communicate.

The types are those of Kilted; of what is written here, Jazzy's are the same.
"""

from pathlib import Path
from typing import Any, NamedTuple

from rosbags.typesys import Stores, get_types_from_msg, get_typestore

COMMUNICATE = "fipa_msgs/msg/Communicate"
LOG = "rcl_interfaces/msg/Log"
LOG_LEVELS = {"debug": 10, "info": 20, "warning": 30, "error": 40}
"""Of lines of a log, as rcl_interfaces/Log has them."""
MARKER, MARKERS = "visualization_msgs/msg/Marker", "visualization_msgs/msg/MarkerArray"
CUBE, SPHERE, CYLINDER, SPHERES, TRIANGLES = 1, 2, 3, 7, 11
"""Types of a marker."""
ADD, DELETE_ALL = 0, 3
"""Its actions."""
DEFINITION = Path(__file__).parent / "fipa_msgs" / "msg" / "Communicate.msg"
TYPES = get_typestore(Stores.ROS2_KILTED)
TYPES.register(get_types_from_msg(DEFINITION.read_text(encoding="utf-8"), COMMUNICATE))
_NS = 1_000_000_000


TRIGGER = "std_srvs/srv/Trigger"
TRIGGER_HASH = "RIHS01_eeff2cd6fa5ad9d27cdf4dec64818317839b62f212a91e6b5304b634b2062c5f"
"""Of the service, in Kilted's std_srvs 5.5.1 (share/std_srvs/srv/Trigger.json); rosbags has no
services.
"""
_TRIGGERED = "std_srvs/srv/msg/Trigger_Response"
TYPES.register(get_types_from_msg("bool success\nstring message\n", _TRIGGERED))


class Topic(NamedTuple):
    """A topic and its type. `latched`: whoever comes later gets the last message, too."""

    name: str
    kind: str
    latched: bool = False


class Entry(NamedTuple):
    """A message on a topic at `at` [unix s]. `latched`: whoever comes later gets it, too."""

    at: float
    topic: str
    kind: str
    message: Any
    latched: bool = False


def definition(kind: str) -> str:
    """The definition of a type with those that it uses, as an MCAP file has it (ros2msg)."""
    text, _ = TYPES.generate_msgdef(kind, ros_version=2)
    return text


def hashed(kind: str) -> str:
    """The hash by which nodes know a type, RIHS01_..."""
    return str(TYPES.hash_rihs01(kind))


def encoded(entry: Entry) -> bytes:
    """The message in CDR."""
    return bytes(TYPES.serialize_cdr(entry.message, entry.kind))


def triggered(success: bool, text: str) -> bytes:
    """The answer of a service of the type std_srvs/Trigger, in CDR."""
    told = message(_TRIGGERED, success=success, message=text)
    return bytes(TYPES.serialize_cdr(told, _TRIGGERED))


def message(kind: str, **fields: Any) -> Any:
    """A message of a type, such as "std_msgs/msg/String", with all of its fields. Numbers in
    sequences are arrays of numpy.
    """
    return TYPES.types[kind](**fields)


def nanoseconds(at: float) -> int:
    """Unix seconds as ROS counts them."""
    return round(at * _NS)


def stamp(at: float) -> Any:
    """A builtin_interfaces/Time of unix seconds."""
    sec, nanosec = divmod(nanoseconds(at), _NS)
    return message("builtin_interfaces/msg/Time", sec=sec, nanosec=nanosec)


def header(at: float, frame: str = "") -> Any:
    """A std_msgs/Header: unix seconds, and the frame in which the rest stands."""
    return message("std_msgs/msg/Header", stamp=stamp(at), frame_id=frame)


STATUS = "diagnostic_msgs/msg/DiagnosticStatus"
DIAGNOSTICS = "diagnostic_msgs/msg/DiagnosticArray"
OK, WARN, ERROR = 0, 1, 2
"""Levels of a diagnosis."""


def diagnostics(at: float, *found: Any) -> Entry:
    """What is diagnosed at a time."""
    told = message(DIAGNOSTICS, header=header(at), status=list(found))
    return Entry(at, "/diagnostics", DIAGNOSTICS, told)


def diagnosis(name: str, level: int, text: str, of: str = "", **values: object) -> Any:
    """One of them: `of` what hardware, `values` in words."""
    kind = "diagnostic_msgs/msg/KeyValue"
    pairs = [message(kind, key=key, value=str(value)) for key, value in values.items()]
    return message(STATUS, level=level, name=name, message=text, hardware_id=of, values=pairs)
