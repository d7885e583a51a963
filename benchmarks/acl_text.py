"""Time to read ACL text of growing length: each kind of text in eight lengths, in CPU nanoseconds per byte.

    python benchmarks/acl_text.py

Linear where a row stays level. Texts that are refused are measured too, since a stranger may send them.
"""

import time
from collections.abc import Callable
from contextlib import suppress

from fipa_codec.acl_string import MAX_ITEMS, AclSyntaxError, parse

LENGTHS = (32, 64, 128, 256, 512, 1024, 2048, 4096)
"""kB of a text."""
ROUNDS = 5
TEXTS: dict[str, Callable[[int], str]] = {
    "content of one string": lambda n: f'(inform :content "{"x" * n}")',
    "escaped quotes": lambda n: f'(inform :content "{chr(92) + chr(34)}{(chr(92) + chr(34)) * (n // 2)}")',
    "words without white space": lambda n: f"(inform :language a{':protocola:language#1' * (n // 21)})",
    "numbers after #": lambda n: f"(inform :language a{'#11' * (n // 3)})",
    "one user-defined name": lambda n: f"(inform :X-{'#1' * (n // 2)} b)",
    "a length of zeros": lambda n: f"(inform :content #{'0' * n})",
    "parameters": lambda n: f"(inform {''.join(f' :X-{i} b' for i in range(min(n // 8, MAX_ITEMS - 1)))})",
    "addresses": lambda n: f"(inform :sender (agent-identifier :name a :addresses (sequence {'a ' * (n // 2)})))",
}


def once(text: bytes) -> float:
    """Return the least CPU time of some rounds [s]: other work of the machine is not counted."""
    times = []
    for _ in range(ROUNDS):
        start = time.process_time()
        with suppress(AclSyntaxError):
            parse(text)
        times.append(time.process_time() - start)
    return min(times)


def main() -> None:
    print(f"{'CPU ns a byte at':28}" + "".join(f"{n:>9} kB" for n in LENGTHS))
    for name, made in TEXTS.items():
        texts = [made(1000 * n).encode() for n in LENGTHS]
        print(f"{name:28}" + "".join(f"{1e9 * once(text) / len(text):>12.2f}" for text in texts), flush=True)


if __name__ == "__main__":
    main()
