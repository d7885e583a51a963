"""For all tests: hypothesis looks for what is false, not for what is slow; machines with other work run them, too."""

from hypothesis import HealthCheck, settings

settings.register_profile("any machine", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("any machine")
