"""Paths as users write them."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

from p2gd_fgo.errors import DataError


def user_path(text: str, field: str) -> Path:
    """The path that a field of the configuration names, ``~`` expanded; it need not exist.

    Raises
    ------
    DataError
        Nothing can lie there: an unknown user, a name too long, a null byte, a folder that may not
        be looked into.
    """
    try:
        path = Path(text).expanduser()
        with suppress(FileNotFoundError, NotADirectoryError):
            path.stat()
    except (OSError, RuntimeError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else str(error)
        shown = text if len(text) <= 80 else f"{text[:80]}…"
        raise DataError(f"{field}: {shown!r} can't be a path ({reason}): give another") from None
    return path
