"""A folder of keys may have any name: Zenoh makes parameters of an endpoint of the files in it."""

import string
from pathlib import Path

import pytest
from guarded import Guarded

pytestmark = pytest.mark.zenoh


def test_every_mark_may_be_in_the_name(tmp_path: Path) -> None:
    """Those of Zenoh's endpoints, too."""
    one = Guarded(tmp_path / f"ö {string.punctuation.replace('/', '')}")
    try:
        assert str(one.guard.zid()) in map(str, one.session("hi").info.routers_zid())
    finally:
        one.close()
