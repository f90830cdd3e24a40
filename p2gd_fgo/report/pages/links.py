"""URLs from a page to the files beside it, and names of files made from names of runs."""

from __future__ import annotations

import os
import re
from pathlib import Path
from urllib.parse import quote


def relative_url(target: Path, page: Path) -> str:
    """URL of a file or folder as seen from ``page``; every special character is escaped."""
    start = page.resolve().parent
    url = quote(Path(os.path.relpath(target.resolve(), start)).as_posix())
    return f"{url}/" if target.is_dir() else url


def file_name(*parts: str) -> str:
    """Parts joined to the name of a file that every system takes."""
    plain = [re.sub(r"[^A-Za-z0-9._-]+", "-", part).strip("-.") for part in parts]
    return "_".join(part for part in plain if part)
