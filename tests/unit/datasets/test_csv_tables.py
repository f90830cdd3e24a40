"""The table reader: exact stamps, lenient layout, strict numbers."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from p2gd_fgo.datasets.csv_tables import read_image_list, read_table
from p2gd_fgo.errors import DataError

S = 1403636580838555649


def written(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "data.csv"
    path.write_bytes(text.encode())
    return path


@pytest.mark.parametrize(
    "text",
    [
        f"#t,a,b\n{S},1,2\n{S + 1},3,4\n",
        f"t [ns],a,b\n{S},1,2\n{S + 1},3,4",
        f"{S},1,2\n{S + 1},3,4\n",
        f"#t,a,b\r\n{S},1,2\r\n{S + 1},3,4\r\n",
        f"# one\n# two\n\n{S},1,2,\n\n   \n{S + 1}, 3 ,\t4, \n# end\n",
        f"\ufeff#t,a,b\n{S},1.0,2e0\n{S + 1},+3,.4e1\n",
        f"\n\ntimestamp\n{S},1,2\n{S + 1},3,4,99\n",
    ],
    ids=["usual", "bare header", "no header", "windows", "messy", "byte-order mark", "long row"],
)
def test_layouts_that_are_read(tmp_path: Path, text: str) -> None:
    table = read_table(written(tmp_path, text), (3,))
    assert table.stamps_ns.dtype == np.int64
    assert table.stamps_ns.tolist() == [S, S + 1]
    assert table.values.tolist() == [[1, 2], [3, 4]]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "the file is empty"),
        ("\n \n", "the file is empty"),
        ("#t,a,b\n", "no data rows"),
        ("t,a,b\n", "no data rows"),
        (f"#t\n{S},1,2\n\n{S},1\n", "line 4: 2 columns found, 3 needed"),
        (f"#t\n{S},1\n", "line 2: 2 columns found, at least 3 needed"),
        (f"#t\n{S},1,2\n{S},1,x7\n", "line 3: column 3 holds 'x7', not a number"),
        (f"#t\n{S},1,2\n{S},,3\n", "line 3: column 2 holds '', not a number"),
        (f"{S},1,2\n1403636580.838,1,2\n", "line 2: stamp '1403636580.838' is not a whole"),
        (f"{S},1,2\n1.4e18,1,2\n", "line 2: stamp '1.4e18' is not a whole"),
        (f"1.4e18,1,2\n{S},1,2\n", "line 1: stamp '1.4e18' is not a whole"),
        (f"{S},1,2\n{S}000,1,2\n", "line 2: stamp .* doesn't fit into 64 bits"),
    ],
)
def test_bad_tables_name_file_and_line(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(DataError, match=message) as caught:
        read_table(written(tmp_path, text), (3,))
    assert str(tmp_path / "data.csv") in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_missing_or_binary_file(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="no such file"):
        read_table(tmp_path / "nothing.csv", (3,))
    path = tmp_path / "binary.csv"
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(DataError, match="not readable as text"):
        read_table(path, (3,))


def test_the_widest_layout_that_fits_is_read(tmp_path: Path) -> None:
    path = written(tmp_path, f"{S},1,2,3,4\n")
    assert read_table(path, (2, 4, 6)).values.tolist() == [[1, 2, 3]]


def test_image_names(tmp_path: Path) -> None:
    path = written(tmp_path, f"#timestamp [ns],filename\r\n{S}, left 1.png ,\r\n{S + 9},b.jpg\r\n")
    stamps, names = read_image_list(path)
    assert stamps.tolist() == [S, S + 9]
    assert names == ["left 1.png", "b.jpg"]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (f"#t\n{S},a.png\n{S},b.png\n", "line 3: image stamp .* must increase"),
        (f"#t\n{S},a.png\n{S - 1},b.png\n", "line 3: image stamp .* must increase"),
        (f"#t\n{S}\n", "line 2: a stamp in ns and a file name expected"),
        ("#t\n12.5,a.png\n", "line 2: stamp '12.5' is not a whole"),
        ("#timestamp,filename\n", "no data rows"),
    ],
)
def test_bad_image_lists(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(DataError, match=message):
        read_image_list(written(tmp_path, text))
