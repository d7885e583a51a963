"""Sentences as sound, by espeak-ng where it is installed: a WAV file of each. Nothing is kept."""

import asyncio
import shutil
from contextlib import suppress

PROGRAM = "espeak-ng"
LONGEST_TEXT = 400
"""Characters; estimate: half a minute."""
MADE_S = 10.0
AT_ONCE = 2
WORDS_A_MINUTE = "140"
"""espeak-ng's own is 175; slower for ears that are old (estimate)."""
_room = asyncio.Semaphore(AT_ONCE)


def available() -> bool:
    """Whether sentences can be spoken here."""
    return shutil.which(PROGRAM) is not None


async def wav(text: str, language: str) -> bytes | None:
    """Return the sound of a text, in a language of the catalogue; None where it cannot be made in time."""
    async with _room:
        try:
            process = await asyncio.create_subprocess_exec(
                PROGRAM, "-v", language, "-s", WORDS_A_MINUTE, "--stdin", "--stdout",
                stdin=asyncio.subprocess.PIPE, stdout=asyncio.subprocess.PIPE, stderr=asyncio.subprocess.DEVNULL,
            )  # fmt: skip
        except OSError:
            return None
        try:
            async with asyncio.timeout(MADE_S):
                sound, _ = await process.communicate(text[:LONGEST_TEXT].encode(errors="replace"))
        except TimeoutError:
            return None
        finally:
            with suppress(ProcessLookupError):
                process.kill()
        return sound if process.returncode == 0 and sound else None
