"""Fixtures shared by all tests."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from hypothesis import settings

# Speed is judged by a benchmark: a busy machine must not fail a test.
settings.register_profile("untimed", deadline=None)
settings.load_profile("untimed")

for _variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_variable, "1")


@pytest.fixture(scope="session")
def recordings() -> Path:
    """Folder of the real recordings, beside the project."""
    path = Path(__file__).resolve().parents[2] / "shared" / "data"
    if not path.is_dir():
        pytest.skip(f"no recordings at {path}")
    return path


@pytest.fixture(scope="session")
def short_demo(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of 7 s of the demo in small images: 2 s of standstill, then 3.9 m."""
    from p2gd_fgo.simulation.demo import DemoParameters, demo_sequence  # loads numpy: not earlier

    parameters = DemoParameters(duration_s=7.0, width=400, height=300)
    return demo_sequence(tmp_path_factory.mktemp("demo"), parameters=parameters)
