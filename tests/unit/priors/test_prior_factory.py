"""Which source the configuration's name stands for, and what it says when it can't be had."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from prior_scenes import HORIZON, arc, stamps, window

from p2gd_fgo.config import PriorsConfig
from p2gd_fgo.errors import ConfigError, DataError
from p2gd_fgo.geometry.pose import inverse
from p2gd_fgo.priors import PriorSource, make_prior_source
from p2gd_fgo.trajectory_files import write_tum
from p2gd_fgo.types import FloatArray, Truth

IMAGES = stamps(60)
DRIVE = arc(IMAGES)
TRUTH = Truth(arc(stamps(600, 10_000_000)))


def make(config: PriorsConfig, *, recorded: bool = True, seed: int = 0) -> PriorSource:
    return make_prior_source(
        config,
        HORIZON,
        truth=TRUTH if recorded else None,
        image_stamps_ns=IMAGES if recorded else None,
        seed=seed,
    )


def ahead(source: PriorSource, index: int = 10) -> FloatArray:
    found = source.poses(int(IMAGES[index]), window(DRIVE, index))
    assert found is not None
    np.testing.assert_array_equal(found.stamps_ns, IMAGES[index + 1 : index + 21])
    return found.T_imu0_imu


def the_way() -> FloatArray:
    return inverse(DRIVE.T_world_imu[10]) @ DRIVE.T_world_imu[11:31]


@pytest.mark.parametrize("source", ["auto", "truth"])
def test_truth(source: str) -> None:
    made = make(PriorsConfig.model_validate({"source": source}))
    assert (made.description, made.independent) == ("truth", True)
    np.testing.assert_allclose(ahead(made), the_way(), atol=1e-7)


@pytest.mark.parametrize("source", ["auto", "constant_velocity"])
def test_without_a_recording_the_motion_goes_on(source: str) -> None:
    made = make(PriorsConfig.model_validate({"source": source}), recorded=False)
    assert made.description == "constant velocity (no planner)"
    assert not made.independent
    np.testing.assert_allclose(ahead(made), the_way(), atol=1e-7)


@pytest.mark.parametrize("source", ["truth", "noisy_truth"])
def test_truth_must_be_there(source: str) -> None:
    with pytest.raises(ConfigError, match=f"priors.source is '{source}'.*no recording with truth"):
        make(PriorsConfig.model_validate({"source": source}), recorded=False)


def test_noisy_truth_is_drawn_from_the_seed() -> None:
    config = PriorsConfig(source="noisy_truth", position_noise=0.1, yaw_noise_deg=1.0)
    made = make(config)
    assert made.description == "truth + 0.1 m, 1° white noise"
    np.testing.assert_array_equal(ahead(made), ahead(make(config)))
    assert not np.array_equal(ahead(made), ahead(make(config, seed=1)))
    off = np.linalg.norm((ahead(made) - the_way())[:, :3, 3], axis=1)
    assert 0.02 < np.median(off) < 1.0


@pytest.mark.parametrize("recorded", [True, False])
def test_a_planners_file_at_its_own_rate(
    recorded: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_tum(tmp_path / "plan.tum", arc(stamps(50, 330_000_000)))
    monkeypatch.chdir(tmp_path)
    made = make(PriorsConfig(source="file", file="plan.tum"), recorded=recorded)
    assert made.description == "file plan.tum"
    np.testing.assert_allclose(ahead(made), the_way(), atol=1e-6)


def test_a_file_that_can_not_be_read_is_named(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"priors\.file is null"):
        make(PriorsConfig(source="file"))
    with pytest.raises(DataError, match="no such trajectory file"):
        make(PriorsConfig(source="file", file=str(tmp_path / "plan.tum")))
    (tmp_path / "plan.tum").write_text("1.0 0 0 0 0 0 0 1\n1.1 0 0 zero 0 0 0 1\n")
    with pytest.raises(DataError, match=r"plan\.tum, line 2"):
        make(PriorsConfig(source="file", file=str(tmp_path / "plan.tum")))


@pytest.mark.parametrize(
    ("source", "description"), [("stream", "handed in with the images"), ("none", "none")]
)
def test_sources_with_nothing_of_their_own(source: str, description: str) -> None:
    made = make(PriorsConfig.model_validate({"source": source}))
    assert made.description == description
    assert made.poses(int(IMAGES[10]), window(DRIVE, 10)) is None
    times = made.image_times.after(int(IMAGES[10]), window(DRIVE, 10), 2)
    np.testing.assert_array_equal(times, IMAGES[11:13])
