"""Masks, trackers and policies through whole runs of the demo."""

from __future__ import annotations

import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest
from demo_variants import ate_m, opened, settings

from p2gd_fgo.config import Config
from p2gd_fgo.datasets import Sequence
from p2gd_fgo.datasets.asl import AslSequence
from p2gd_fgo.odometry import Odometry
from p2gd_fgo.pipeline import run_sequence
from p2gd_fgo.recorder import RunResult
from p2gd_fgo.types import Estimate, FloatArray, Image, Trajectory, Waiting

BLOCK = 60
IMAGES = 30  # of a repeated run: a second after the standstill


@pytest.fixture(scope="module")
def demo(short_demo: Path) -> AslSequence:
    return opened(short_demo, duration_s=5.0)


@pytest.fixture(scope="module")
def beginning(short_demo: Path) -> AslSequence:
    """Its first images, for repeating what a run made of them."""
    return opened(short_demo, duration_s=IMAGES / 10)


@pytest.fixture(scope="module")
def truth(demo: AslSequence) -> Trajectory:
    assert demo.truth is not None
    return demo.truth.trajectory


@pytest.fixture(scope="module")
def masked(short_demo: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The demo with a black block that wanders through the masks; every seventh has none."""
    copy = tmp_path_factory.mktemp("masked") / "demo"
    shutil.copytree(short_demo, copy)
    folder = copy / "mav0/mask0/data"
    folder.mkdir(parents=True)
    for index, path in enumerate(opened(copy).image_paths):
        if index % 7 != 3:
            mask = np.full((300, 400), 255, np.uint8)
            mask[:, block(index)] = 0
            cv2.imwrite(str(folder / path.name), mask)
    return copy


def block(index: int) -> slice:
    first = 4 * index % (400 - BLOCK)
    return slice(first, first + BLOCK)


class Pixels:
    """Writes down where the features were."""

    def __init__(self) -> None:
        self.pixels: list[FloatArray] = []

    def begin(self, sequence: Sequence, config: Config) -> None:
        self.pixels.clear()

    def frame(
        self, index: int, outcome: Estimate | Waiting, image: Image, odometry: Odometry
    ) -> None:
        self.pixels.append(odometry.observations.pixels)


def digest(result: RunResult) -> bytes:
    """What the front end and the back end made of the first images."""
    tracks, estimate = result.tracks, result.estimate
    features = int(tracks.counts[:IMAGES].sum())
    poses = int(np.searchsorted(estimate.stamps_ns, tracks.stamps_ns[:IMAGES][-1], "right"))
    return b"".join(
        x.tobytes()
        for x in (tracks.ids[:features], tracks.normalized[:features], estimate.T_world_imu[:poses])
    )


@pytest.mark.parametrize("kind", ["grid", "quadtree"])
def test_no_feature_lies_under_its_images_mask(masked: Path, truth: Trajectory, kind: str) -> None:
    sequence = opened(masked, masks="mav0/mask0/data")
    config = settings(dataset__masks="mav0/mask0/data", distribution__kind=kind)
    watcher = Pixels()
    result = run_sequence(sequence, config, watcher)
    assert result.status == "done"
    unmasked = 0
    for index, pixels in enumerate(watcher.pixels):
        u = np.rint(pixels[:, 0])
        under = (u >= block(index).start) & (u < block(index).stop)
        if index % 7 == 3:
            unmasked += int(under.sum())
        else:
            assert not under.any()
    assert unmasked > 0
    assert result.counts["masks_missing"] == 10
    assert "10 images" in next(e.message for e in result.events if e.kind == "masks_missing")
    assert ate_m(result, truth) < 0.1
    if kind == "grid":
        again = opened(masked, masks="mav0/mask0/data", duration_s=IMAGES / 10)
        assert digest(result) == digest(run_sequence(again, config))


def test_an_image_whose_mask_is_broken_is_left_out_with_an_event(
    masked: Path, tmp_path: Path
) -> None:
    copy = tmp_path / "demo"
    shutil.copytree(masked, copy)
    sequence = opened(copy, masks="mav0/mask0/data", duration_s=2.0)
    assert sequence.masks is not None
    (sequence.masks.folder / sequence.image_paths[5].name).write_bytes(b"no image")
    config = settings(dataset__masks="mav0/mask0/data")
    result = run_sequence(sequence, config)
    assert result.status == "done"
    assert result.counts["images_unreadable"] == 1
    assert [e.message for e in result.events if "mask0" in e.message and "decoded" in e.message]


@pytest.fixture(scope="module")
def plain(demo: AslSequence) -> RunResult:
    return run_sequence(demo, settings())


@pytest.mark.parametrize(
    "fields",
    [
        {"frontend__tracker": "orb"},
        {"frontend__continue_consumed": True},
        {"distribution__refill": True},
        {"distribution__kind": "quadtree"},
        {"distribution__kind": "anms"},
        {"distribution__kind": "uniform_random"},
    ],
    ids=str,
)
def test_each_choice_follows_the_truth_and_repeats(
    demo: AslSequence,
    beginning: AslSequence,
    truth: Trajectory,
    plain: RunResult,
    fields: dict[str, object],
) -> None:
    result, again = (run_sequence(s, settings(**fields)) for s in (demo, beginning))
    assert result.status == "done"
    assert digest(result) == digest(again) != digest(plain)
    assert ate_m(result, truth) < 0.05
    assert result.tracks.counts.max() <= 150
    fates = dict(result.counts)
    seen = fates.pop("observations")
    from_the_back_end = ("in_window", "marginalized", "rejected", "muted", "single_view")
    assert sum(v for k, v in fates.items() if k.startswith(from_the_back_end)) == seen


def test_continuing_consumed_features_keeps_every_observation_once(demo: AslSequence) -> None:
    result = run_sequence(demo, settings(frontend__continue_consumed=True))
    tracks = result.tracks
    image = np.repeat(np.arange(len(tracks.counts)), tracks.counts)
    pairs = np.unique(np.column_stack([image, tracks.ids]), axis=0)
    assert len(pairs) == len(tracks.ids)
    _, lengths = np.unique(tracks.ids, return_counts=True)
    assert lengths.max() == result.config.frontend.max_track_length
    assert result.counts["features_consumed"] > 0
