"""The content language of the design, and the registry of it by name."""

from fipa_codec.languages import Languages

from dispatch.languages import job

LANGUAGES = Languages((job.LANGUAGE,))
