"""The certificate by which a tablet knows the page: of an authority of its own, in the run folder.

Not of the fleet's authority. Its keys are made again at each start, so a tablet would have to learn
it again; and each agent's certificate is of it, so that a stolen key of an agent could pose as the
page. A browser that stays paired meets the same certificate, also after a restart of the page.
"""

import datetime as dt
import ssl
import time
from pathlib import Path

from agent_runtime.io.issuing import issue_server
from agent_runtime.io.secured import certificate_file, key_file
from services.page.guard import KEPT_S

NAME = "page"
DAY_S = 86_400.0
DAYS = KEPT_S / DAY_S
"""As long as a browser stays paired."""
LAST_DAYS = 1.0
"""Before its end it is made again, as the keys of the fleet are."""


class Certificate:
    """What a server shows `at` an address or name, and its key. Raise OSError."""

    def __init__(self, folder: Path, at: str) -> None:
        self._folder, self._at = folder, at
        self.context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
        self.context.minimum_version = ssl.TLSVersion.TLSv1_3  # all browsers since 2019 have it
        self.context.set_alpn_protocols(["http/1.1"])
        self._renew_at = 0.0
        self.renew(time.time())

    def renew(self, now: float) -> None:
        """Make it again if its last day has begun [unix s], for connections after that. Raise
        OSError.
        """
        if now < self._renew_at:
            return
        begin = dt.datetime.fromtimestamp(now, dt.UTC)
        until = issue_server(
            self._folder, NAME, self._at, days=DAYS, keep_days=LAST_DAYS, now=begin
        )
        self.context.load_cert_chain(
            certificate_file(self._folder, NAME), key_file(self._folder, NAME)
        )
        self._renew_at = until.timestamp() - LAST_DAYS * DAY_S
