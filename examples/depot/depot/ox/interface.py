"""Requests that a_ox takes (OFFERS) and makes (ASKS), by the use of a protocol."""

from fipa_codec.interfaces import ClassInterfaceInfo

from depot.languages import job, way

OFFERS = {
    "tender_ox": ClassInterfaceInfo([("cfp", "job", [job.Call], job.Offer | job.Carried)]),
}

ASKS = {
    "way_ox": ClassInterfaceInfo([("request", "enter", [way.Enter], None)]),
}
