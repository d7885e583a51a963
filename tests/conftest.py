"""For all tests: hypothesis looks for what is false, not for what is slow; machines with other work run them, too.

Fleets of tests show no pictures (ROCO_VIEW) but where a test is about them: they would only make everything slower.
A fleet in containers on this machine is none of the tests' (DOCKER_HOST). Whoever starts the tests in the background
has them ignore SIGINT; what tests start would inherit that, and is interrupted by some.
"""

import os
import signal

from hypothesis import HealthCheck, settings

settings.register_profile("any machine", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("any machine")
os.environ.setdefault("ROCO_VIEW", "off")
os.environ["DOCKER_HOST"] = "unix:///nowhere"
signal.signal(signal.SIGINT, signal.default_int_handler)
