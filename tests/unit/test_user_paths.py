"""Paths as users write them."""

from __future__ import annotations

from pathlib import Path

import pytest

from p2gd_fgo.errors import DataError
from p2gd_fgo.user_paths import user_path


def test_home_is_expanded_and_nothing_need_be_there(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOME", "/home/someone")
    assert user_path("~/a.png", "dataset.mask") == Path("/home/someone/a.png")
    assert user_path("nowhere/a", "dataset.path") == Path("nowhere/a")


@pytest.mark.parametrize("text", ["~nosuchuser/x", "x" * 300, "a\0b"])
def test_what_can_be_no_path_is_a_sentence(text: str) -> None:
    with pytest.raises(
        DataError, match=r"^dataset\.mask: .* can't be a path \(.*\): give another$"
    ):
        user_path(text, "dataset.mask")
