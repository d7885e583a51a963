"""Wires over real sockets: what goes in comes out, in order, and each condition does what it
says.
"""

import asyncio
import random
import socket
import tempfile
import time
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager, suppress
from functools import wraps
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from operate.fault_proxy import files
from operate.fault_proxy.__main__ import KEPT, Wire
from operate.fault_proxy.files import Conditions

TIMEOUT_S = 30.0
Streams = tuple[asyncio.StreamReader, asyncio.StreamWriter]


class Setup:
    """Both ends of a connection through a wire, whose conditions may be changed."""

    def __init__(self, conditions: Conditions) -> None:
        self.conditions = conditions
        self.here: Streams
        self.there: Streams


def port_of(server: asyncio.Server) -> int:
    """Where it listens."""
    return int(server.sockets[0].getsockname()[1])


@asynccontextmanager
async def wired(
    conditions: Conditions, chance: random.Random | None = None
) -> AsyncIterator[Setup]:
    """A wire between two ends on the loopback interface."""
    setup, arrived = Setup(conditions), asyncio.Queue[Streams]()

    async def accepted(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        await arrived.put((reader, writer))

    far = await asyncio.start_server(accepted, "127.0.0.1", 0)
    chance = chance or random.Random(1)
    wire = Wire("127.0.0.1", port_of(far), lambda: setup.conditions, chance)
    near = await asyncio.start_server(wire.connected, "127.0.0.1", 0)
    setup.here = await asyncio.open_connection("127.0.0.1", port_of(near))
    setup.there = await arrived.get()
    try:
        yield setup
    finally:
        for _, writer in (setup.here, setup.there):
            writer.close()
        near.close()
        far.close()


async def sent(data: bytes, end: Streams) -> None:
    """Send, and say that this is all."""
    end[1].write(data)
    await end[1].drain()
    end[1].write_eof()


async def both(forth: bytes, back: bytes, setup: Setup) -> tuple[bytes, bytes]:
    """Send something each way, and give what arrived."""
    sending = sent(forth, setup.here), sent(back, setup.there)
    *_, there, here = await asyncio.gather(*sending, setup.there[0].read(), setup.here[0].read())
    return there, here


def awaited(test: Callable[..., Awaitable[None]]) -> Callable[..., None]:
    """A test that is awaited, with an end."""

    @wraps(test)
    def bounded(*given: Any, **named: Any) -> None:
        asyncio.run(asyncio.wait_for(test(*given, **named), TIMEOUT_S))

    return bounded


amounts = st.builds(
    Conditions,
    delay=st.sampled_from([0.0, 0.01, 0.05]),
    loss=st.sampled_from([0.0, 0.1]),
    rate=st.sampled_from([0.0, 5e5]),
)


@given(
    amounts,
    st.binary(max_size=200),
    st.integers(1, 400),
    st.binary(max_size=2000),
    st.integers(0, 9),
)
@settings(max_examples=12, deadline=None)
@awaited
async def test_every_byte_arrives_in_order(
    conditions: Conditions, piece: bytes, times: int, back: bytes, seed: int
) -> None:
    """Delayed, lost and slowed as they may be, both ways; then the end."""
    async with wired(conditions, random.Random(seed)) as setup:
        assert await both(piece * times, back, setup) == (piece * times, back)


@awaited
async def test_a_delay_is_waited_for_and_holds_up_no_others() -> None:
    """Much data takes the delay once, not once for each piece."""
    async with wired(Conditions(delay=0.3)) as setup:
        began, data = time.monotonic(), bytes(20 * 16 * 1024)
        assert (await both(data, b"", setup))[0] == data
        assert 0.3 <= time.monotonic() - began < 20 * 0.3


class Once(random.Random):
    """Bad luck that many times, good luck from then on."""

    def __init__(self, times: int) -> None:
        super().__init__(1)
        self.times = times

    def random(self) -> float:
        """Return 0, at the end 1."""
        self.times -= 1
        return 0.0 if self.times >= 0 else 1.0


@awaited
async def test_a_lost_piece_comes_late() -> None:
    """After 0.2 s, and where it is lost again after 0.4 s more."""
    async with wired(Conditions(loss=0.5), Once(2)) as setup:
        began = time.monotonic()
        setup.here[1].write(b"lost twice")
        assert await setup.there[0].readexactly(10) == b"lost twice"
        assert time.monotonic() - began >= 0.6 * 0.95


@awaited
async def test_a_rate_is_a_bound() -> None:
    """Never faster."""
    async with wired(Conditions(rate=100_000.0)) as setup:
        began, data = time.monotonic(), bytes(40_000)
        assert (await both(data, b"", setup))[0] == data
        assert time.monotonic() - began >= 0.4 * 0.95


@awaited
async def test_a_cut_wire_delivers_nothing_and_a_mended_one_all() -> None:
    """Not even the end; both ends stay open. Before the cut everything passes."""
    async with wired(Conditions()) as setup:
        setup.here[1].write(b"before")
        assert await setup.there[0].readexactly(6) == b"before"
        setup.conditions = Conditions(cut=1.0)
        await sent(b"meanwhile", setup.here)
        with pytest.raises(TimeoutError):
            await asyncio.wait_for(setup.there[0].read(1), 0.3)
        setup.conditions = Conditions()
        assert await setup.there[0].read() == b"meanwhile"


@awaited
async def test_what_waits_is_bounded() -> None:
    """A cut wire takes no more than a socket's buffers would."""
    async with wired(Conditions(cut=1.0)) as setup:
        writer = setup.here[1]
        writer.transport.set_write_buffer_limits(0)
        taken = 0
        with suppress(TimeoutError):
            while taken < 64 * KEPT:
                writer.write(bytes(65536))
                await asyncio.wait_for(writer.drain(), 0.5)
                taken += 65536
        assert KEPT / 2 < taken < 32 * KEPT  # the kernel's own buffers are a few MB


@awaited
async def test_corruption_turns_single_bits_over() -> None:
    """As many bytes, a few bits of them others."""
    async with wired(Conditions(corrupt=1.0)) as setup:
        data = bytes(100_000)
        found, untouched = await both(data, b"", setup)
        assert (len(found), untouched) == (len(data), b"")
        bits = [byte.bit_count() for byte in found if byte]
        assert bits
        assert set(bits) == {1}


@awaited
async def test_a_wire_to_nobody_is_closed() -> None:
    """As the router's port would be."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    wire = Wire("127.0.0.1", port, Conditions, random.Random(1))
    near = await asyncio.start_server(wire.connected, "127.0.0.1", 0)
    reader, writer = await asyncio.open_connection("127.0.0.1", port_of(near))
    assert await reader.read() == b""
    writer.close()
    near.close()


@given(
    st.dictionaries(
        st.tuples(st.sampled_from(["pl", "a.b", "router"]), st.sampled_from(files.KINDS)),
        st.floats(0, 1e6),
        max_size=6,
    )
)
def test_conditions_are_those_that_were_put(wanted: dict[tuple[str, str], float]) -> None:
    """Of each wire; ended ones are gone, and so are those of a start before."""
    with tempfile.TemporaryDirectory() as folder:
        run_dir = Path(folder)
        files.put(run_dir, "pl", "cut", 1.0)
        files.tell(run_dir, files.Wires({"router": ("127.0.0.1", 1)}, {"pl": {"router": 2}}))
        for (name, kind), amount in wanted.items():
            files.put(run_dir, name, kind, amount)
        found = files.conditions(run_dir).items()
        told = {(name, kind): getattr(one, kind) for name, one in found for kind in files.KINDS}
        assert {k: v for k, v in told.items() if v} == {k: v for k, v in wanted.items() if v}
        for name, kind in wanted:
            files.put(run_dir, name, kind, None)
        assert files.conditions(run_dir) == {}
