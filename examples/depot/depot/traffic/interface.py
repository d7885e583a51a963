"""Requests that a_traffic takes (OFFERS) and makes (ASKS), by the use of a protocol."""

from fipa_codec.interfaces import ClassInterfaceInfo

from depot.languages import way

OFFERS = {
    "way_mule": ClassInterfaceInfo([("request", "enter", [way.Enter], None)]),
    "way_ox": ClassInterfaceInfo([("request", "enter", [way.Enter], None)]),
}

ASKS: dict[str, ClassInterfaceInfo] = {}
