"""Requests that a_dispatcher takes (OFFERS) and makes (ASKS), by the use of a protocol."""

from fipa_codec.interfaces import ClassInterfaceInfo

from depot.languages import job, order

OFFERS = {
    "order": ClassInterfaceInfo([("request", "carry", [order.Carry], order.Delivered)]),
    "watch": ClassInterfaceInfo([("subscribe", "figures", [order.Watch], order.Figures)]),
}

ASKS = {
    "tender_mule": ClassInterfaceInfo([("cfp", "job", [job.Call], job.Offer | job.Carried)]),
    "tender_ox": ClassInterfaceInfo([("cfp", "job", [job.Call], job.Offer | job.Carried)]),
}
