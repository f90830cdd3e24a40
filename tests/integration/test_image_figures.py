"""Pictures of single images of a run: which there are, and what is said where there are none."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from demo_variants import opened, settings, spoilt

from p2gd_fgo.config import override
from p2gd_fgo.experiment import Experiment, run_experiment
from p2gd_fgo.pipeline import run_sequence
from p2gd_fgo.report.frame_capture import FrameCapture, Observers

SHORT = {"dataset__duration_s": 3.5, "initialization__kind": "given"}


@pytest.fixture(scope="module")
def holed(short_demo: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The demo without its image 20."""
    copy = spoilt(short_demo, tmp_path_factory.mktemp("holed"))
    stamp = opened(copy).image_stamps_ns[20]
    (copy / "mav0" / "cam0" / "data" / f"{stamp}.png").unlink()
    return copy


def run(folder: Path, out: Path, distribution: str, figures: tuple[int, ...]) -> Experiment:
    config = settings(**SHORT, distribution__kind=distribution)
    config = override(config, {"dataset.path": str(folder)})
    return run_experiment(config, out=out, figures=figures)


def test_missing_images_and_those_without_p2gd_are_said(holed: Path, tmp_path: Path) -> None:
    done = run(holed, tmp_path / "out", "p2gd", (0, 20, 33, 35))
    made = {path.name for path in (done.path / "figures").iterdir()}
    assert made == {"features_000000.png", "p2gd_000033.png", "features_000035.png"}
    said = [event.message for event in done.events if "figure" in event.kind]
    alone = "shows features and quotas alone: P2GD did not run"
    assert said == [
        f"the picture of image 0 {alone}: the estimator had not started",
        "no picture of image 20: the run did not process it",
        f"the picture of image 35 {alone}: no image follows",
    ]


def test_other_distributions_get_their_quotas_without_a_remark(
    short_demo: Path, tmp_path: Path
) -> None:
    done = run(short_demo, tmp_path / "out", "grid", (33,))
    assert [path.name for path in (done.path / "figures").iterdir()] == ["features_000033.png"]
    assert not [event for event in done.events if "figure" in event.kind]


def test_without_figures_there_is_no_folder(short_demo: Path, tmp_path: Path) -> None:
    assert not (run(short_demo, tmp_path / "out", "grid", ()).path / "figures").exists()


def test_what_is_captured(short_demo: Path) -> None:
    first, second = FrameCapture((0, 30)), FrameCapture((31,))
    config = settings(**SHORT, distribution__kind="p2gd")
    result = run_sequence(opened(short_demo, duration_s=3.5), config, Observers(first, second))
    assert set(first.snapshots) == {0, 30} and set(second.snapshots) == {31}
    begin, later = first.snapshots[0], first.snapshots[30]
    assert begin.new.all() and begin.explanation is None and begin.quotas is not None
    assert later.explanation is not None and later.quotas is not None
    np.testing.assert_array_equal(later.explanation.quotas, later.quotas)
    assert later.seconds == pytest.approx(3.0) and later.image.shape == (300, 400)
    counts, ids = result.tracks.counts, result.tracks.ids
    upto = np.cumsum(counts)
    old, here = ids[: upto[29]], ids[upto[29] : upto[30]]
    np.testing.assert_array_equal(later.new, ~np.isin(here, old))
    assert 0 < later.new.sum() < len(later.new) == counts[30]
