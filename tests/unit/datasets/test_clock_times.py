"""Times of day, to the nanosecond."""

from __future__ import annotations

from pathlib import Path

import pytest

from p2gd_fgo.datasets.clock_times import read_clock_times
from p2gd_fgo.errors import DataError


def test_fractions_and_empty_lines(tmp_path: Path) -> None:
    path = tmp_path / "timestamps.txt"
    path.write_text(
        "2011-09-26 13:02:25.964389445\n\n2011-09-26 13:02:26.05\n1970-01-01 00:00:01\n"
    )
    stamps, rows = read_clock_times(path)
    assert stamps.tolist() == [1_317_042_145_964_389_445, 1_317_042_146_050_000_000, 1_000_000_000]
    assert rows == [0, 2, 3]


@pytest.mark.parametrize(
    "text", ["yesterday", "2011-13-26 13:02:25", "1317042145.96", "0001-01-01 00:00:00", "９" * 20]
)
def test_what_is_no_time(tmp_path: Path, text: str) -> None:
    path = tmp_path / "timestamps.txt"
    path.write_text(f"2011-09-26 13:02:25.9\n{text}\n", encoding="utf-8")
    with pytest.raises(DataError, match=r"timestamps\.txt(, line 2: .* is no time|: not readable)"):
        read_clock_times(path)
