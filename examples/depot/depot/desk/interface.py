"""Requests that a_desk takes (OFFERS) and makes (ASKS), by the use of a protocol."""

from fipa_codec.interfaces import ClassInterfaceInfo

from depot.languages import order

OFFERS: dict[str, ClassInterfaceInfo] = {}

ASKS = {
    "order": ClassInterfaceInfo([("request", "carry", [order.Carry], order.Delivered)]),
    "watch": ClassInterfaceInfo([("subscribe", "figures", [order.Watch], order.Figures)]),
}
