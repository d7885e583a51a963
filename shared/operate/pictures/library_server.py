"""Rerun's server by its Python library: `python -m operate.pictures.library_server GRPC WEB KEPT`.

The library's server listens at every interface. It needs a recording of its own, which stays empty.
With the name of what is drawn, the web viewer would take its own layout for ours (tried).
"""

import signal
import sys

import rerun as rr


def main(grpc: int, web: int, kept: str) -> None:
    """Serve what is logged and the web viewer's page until a signal ends it."""
    own = rr.RecordingStream("server", recording_id="server", send_properties=False)
    rr.serve_grpc(grpc_port=grpc, server_memory_limit=kept, recording=own)
    rr.serve_web_viewer(web_port=web, open_browser=False)
    while True:
        signal.pause()


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]), sys.argv[3])
