"""The content languages of the design, one module each, and the registry of them by name."""

from fipa_codec.languages import Languages

from depot.languages import job, order, way

LANGUAGES = Languages((order.LANGUAGE, job.LANGUAGE, way.LANGUAGE))
