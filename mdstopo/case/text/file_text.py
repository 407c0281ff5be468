"""The text of a case file, or the mistake why it cannot be read."""

from __future__ import annotations

import hashlib
from pathlib import Path

from mdstopo.case.text.errors import Mistake


class FileTextError(Exception):
    """The file cannot be read; carries the one mistake."""

    def __init__(self, message: str, line: int = 1, column: int = 1) -> None:
        self.mistake = Mistake("", message, line, column)
        super().__init__(message)


def text_in(place: Path) -> tuple[str, str]:
    """The text of a file, and the SHA-256 of its bytes. Raises FileTextError."""
    try:
        if place.exists() and not place.is_file():
            raise FileTextError("this is not a file")
        data = place.read_bytes()
    except FileNotFoundError:
        raise FileTextError("there is no such file") from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise FileTextError(f"the file cannot be read: {reason}") from None
    try:
        return data.decode("utf-8-sig"), hashlib.sha256(data).hexdigest()
    except UnicodeDecodeError as error:
        before = data[: error.start]
        line = before.count(b"\n") + 1
        start = before.rfind(b"\n") + 1
        column = len(before[start:].decode("utf-8-sig", "replace")) + 1
        message = f"the byte 0x{data[error.start]:02X} is not UTF-8; save the file as UTF-8"
        raise FileTextError(message, line, column) from None
