"""A request to what people use of the robot: hi (docs/http.md) and the page, which let in who has the token. Blocks."""

import http.client

import msgspec

from companion.run_files import HiAddress, PageAddress

HERE = "127.0.0.1"


def answered(
    address: HiAddress | PageAddress,
    verb: str,
    path: str,
    body: msgspec.Struct | None = None,
    *,
    host: str = HERE,
    patience_s: float,
) -> tuple[int, bytes]:
    """Status and body of the answer. `host`: where it listens if not here; it is asked by the name it expects.

    Raise OSError or http.client.HTTPException where nobody answers within `patience_s` [s].
    """
    connection = http.client.HTTPConnection(host, address.port, timeout=patience_s)
    headers = {
        "Authorization": f"Bearer {address.token}",
        "Content-Type": "application/json",
        "Host": f"{HERE}:{address.port}",
    }
    try:
        connection.request(verb, path, msgspec.json.encode(body) if body is not None else b"", headers)
        answer = connection.getresponse()
        return answer.status, answer.read()
    finally:
        connection.close()
