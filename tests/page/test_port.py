"""The port that ROCO_PAGE names is another program's."""

import re
import socket

import pytest

from services.page.__main__ import _bound


def test_a_port_that_is_taken_is_named_with_its_variable():
    """`roco status` shows these words of a page that was given up."""
    with socket.create_server(("127.0.0.1", 0)) as other:
        port = other.getsockname()[1]
        words = re.escape(f"127.0.0.1:{port} cannot be listened at: Address already in use; ROCO_PAGE names another")
        with pytest.raises(OSError, match=words):
            _bound("127.0.0.1", port)
