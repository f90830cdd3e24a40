from __future__ import annotations

import numpy as np
import pytest
from frontend_scenes import CAMERA, HEIGHT, WIDTH, rotated_view, settings, shifted, texture

from p2gd_fgo.config import FrontendConfig
from p2gd_fgo.errors import ConfigError, DataError
from p2gd_fgo.frontend import CellQuotas, Frontend, TrackSummary
from p2gd_fgo.geometry import so3
from p2gd_fgo.geometry.camera import EquidistantCamera
from p2gd_fgo.types import Image, Observations

QUOTAS = CellQuotas(np.full((3, 4), 5, np.int64))


def _frontend(seed: int = 0, mask: Image | None = None, **changes: object) -> Frontend:
    return Frontend(CAMERA, settings(**changes), seed, mask)


def _drift(count: int) -> list[Image]:
    """A texture that moves by (1.5, -0.5) px an image."""
    image = texture(2)
    return [shifted(image, (1.5 * k, -0.5 * k)) for k in range(count)]


def _run(frontend: Frontend, images: list[Image]) -> list[Observations]:
    out = []
    for k, image in enumerate(images):
        frontend.track(k, image, np.eye(3))
        frontend.extract(QUOTAS)
        out.append(frontend.observations())
    return out


def test_tracks_follow_the_motion_under_their_ids() -> None:
    first, second = _run(_frontend(), _drift(2))
    common, i, j = np.intersect1d(first.ids, second.ids, return_indices=True)
    assert len(common) > 0.8 * len(first)
    flow = second.pixels[j] - first.pixels[i]
    assert np.percentile(np.linalg.norm(flow - [1.5, -0.5], axis=1), 95) < 0.1
    np.testing.assert_allclose(CAMERA.distort(second.normalized), second.pixels, atol=1e-6)
    assert (first.stamp_ns, second.stamp_ns) == (0, 1)


def test_quotas_and_cap_hold_after_every_image() -> None:
    frontend = _frontend(max_features=40)
    for k, image in enumerate(_drift(12)):
        frontend.track(k, image, np.eye(3))
        tracked = len(frontend.buffer)
        new = frontend.extract(QUOTAS)
        assert len(frontend.buffer) == tracked + new <= 40
    assert len(frontend.buffer) == 40


def test_a_summary_accounts_for_every_feature() -> None:
    frontend = _frontend(max_track_length=3)
    before = 0
    for k, image in enumerate(_drift(8)):
        s = frontend.track(k, image, np.eye(3))
        lost = s.lost_klt + s.lost_forward_backward + s.lost_outside + s.lost_outlier
        assert before == s.tracked + s.consumed + lost
        assert s.tracked == len(frontend.buffer)
        frontend.extract(QUOTAS)
        before = len(frontend.buffer)


def test_a_track_at_the_maximum_length_is_consumed() -> None:
    frontend = _frontend(max_track_length=4)
    images = [texture(2)] * 9
    lengths: dict[int, int] = {}
    for k, image in enumerate(images):
        summary = frontend.track(k, image, np.eye(3))
        assert summary.consumed == (60 if k in (4, 8) else 0)
        frontend.extract(QUOTAS)
        for identity in frontend.buffer.ids.tolist():
            lengths[identity] = lengths.get(identity, 0) + 1
    assert max(lengths.values()) == 4
    assert len(lengths) == 180


def test_a_consumed_track_can_be_continued_under_a_new_id() -> None:
    frontend = _frontend(max_track_length=4, continue_consumed=True)
    observations = _run(frontend, [texture(2)] * 6)
    assert not np.intersect1d(observations[3].ids, observations[4].ids).size
    np.testing.assert_allclose(observations[3].pixels, observations[4].pixels, atol=0.01)
    assert frontend.buffer.lengths.tolist() == [2] * 60
    assert frontend.buffer.disparity_px(3)[1] == 60


def test_ids_are_unique_in_an_image_and_never_come_back() -> None:
    images = [*_drift(6), np.zeros((HEIGHT, WIDTH), np.uint8), *_drift(6)]
    gone: set[int] = set()
    previous: set[int] = set()
    for observation in _run(_frontend(max_track_length=3), images):
        ids = set(observation.ids.tolist())
        assert len(ids) == len(observation)
        assert not ids & gone
        gone |= previous - ids
        previous = ids


def test_the_gyro_prediction_saves_tracks_in_a_fast_turn() -> None:
    R = np.asarray(so3.exp(np.array([0.02, 0.2, 0.05])))
    images = [texture(4), rotated_view(texture(4), R)]

    def tracked(predict: bool) -> int:
        frontend = _frontend(predict_flow=predict, klt_levels=3)
        frontend.track(0, images[0], None)
        frontend.extract(QUOTAS)
        return frontend.track(1, images[1], R).tracked

    assert tracked(True) >= 35  # the others left the image
    assert tracked(False) < 0.3 * tracked(True)


def test_rotation_beyond_the_field_of_view_loses_everything_quietly() -> None:
    frontend = _frontend()
    frontend.track(0, texture(), None)
    frontend.extract(QUOTAS)
    R = np.asarray(so3.exp(np.array([0.0, 3.0, 0.0])))
    assert frontend.track(1, texture(8), R).tracked < 20  # chance matches


def test_same_seed_same_features_other_seed_others() -> None:
    faint = [(110 + 0.1 * image.astype(np.float64)).astype(np.uint8) for image in _drift(5)]

    def digest(seed: int) -> list[bytes]:
        observations = _run(_frontend(seed, fast_threshold=9), faint)
        return [o.ids.tobytes() + o.pixels.tobytes() for o in observations]

    assert digest(0) == digest(0)
    assert digest(0) != digest(1)


def test_seeds_move_the_fast_threshold_by_at_most_one() -> None:
    """Too few corners for the quotas: the lower threshold must find more."""
    counts = []
    flat = (110 + 0.06 * texture(2).astype(np.float64)).astype(np.uint8)
    for seed in range(3):
        frontend = _frontend(seed, fast_threshold=6, min_distance_px=2.0, max_features=2000)
        frontend.track(0, flat, None)
        counts.append(frontend.extract(CellQuotas(np.full((3, 4), 500, np.int64))))
    assert counts[2] > counts[0] > counts[1]


def test_nothing_under_the_mask() -> None:
    mask = np.full((HEIGHT, WIDTH), 255, np.uint8)
    mask[:, 160:] = 0
    for observation in _run(_frontend(mask=mask), _drift(10)):
        assert len(observation) > 10
        assert (observation.pixels[:, 0] < 159.5).all()


def test_a_black_image_midway() -> None:
    frontend = _frontend()
    black = np.zeros((HEIGHT, WIDTH), np.uint8)
    observations = _run(frontend, [texture(), black, black, texture(), texture()])
    assert [len(o) for o in observations] == [60, 0, 0, 60, 60]
    assert frontend.buffer.lengths.tolist() == [2] * 60


def test_first_image_and_before() -> None:
    frontend = _frontend()
    with pytest.raises(ValueError, match="track"):
        frontend.extract(QUOTAS)
    assert frontend.track(7, texture(), None) == TrackSummary()
    with pytest.raises(ValueError, match="shape"):
        frontend.extract(CellQuotas(np.ones((4, 3), np.int64)))


def test_equalisation_finds_features_in_a_dim_image() -> None:
    dim = (texture().astype(np.float64) / 16).astype(np.uint8)
    counts = []
    for equalize in (False, True):
        frontend = _frontend(equalize=equalize)
        frontend.track(0, dim, None)
        counts.append(frontend.extract(QUOTAS))
    assert counts[1] > counts[0] + 30


def test_wrong_inputs_are_refused_by_name() -> None:
    with pytest.raises(DataError, match=r"dataset\.mask"):
        _frontend(mask=np.zeros((10, 10), np.uint8))
    with pytest.raises(DataError, match="calibration"):
        _frontend().track(0, np.zeros((10, 10), np.uint8), None)
    with pytest.raises(ConfigError, match=r"frontend\.grid"):
        Frontend(CAMERA, FrontendConfig(), 0)


def _half(columns: slice) -> Image:
    mask = np.full((HEIGHT, WIDTH), 255, np.uint8)
    mask[:, columns] = 0
    return mask


def test_a_mask_holds_for_its_own_image() -> None:
    frontend = _frontend()
    frontend.track(0, texture(2), None)
    frontend.extract(QUOTAS)
    full = frontend.capacity.copy()
    here = int((frontend.buffer.pixels[:, 0] > 160).sum())
    right = _half(slice(160, None))
    summary = frontend.track(1, texture(2), np.eye(3), right)
    assert summary.lost_outside >= here > 10
    assert (frontend.capacity[:, 2:] == 0).all() and (frontend.capacity[:, :2] == full[:, :2]).all()
    assert frontend.allowed is not None and not frontend.allowed[:, 160:].any()
    frontend.extract(QUOTAS)
    assert (frontend.buffer.pixels[:, 0] < 159.5).all()
    frontend.track(2, texture(2), np.eye(3))
    assert [frontend.allowed] == [None]
    np.testing.assert_array_equal(frontend.capacity, full)
    frontend.extract(QUOTAS)
    assert (frontend.buffer.pixels[:, 0] > 160).sum() > 10


def test_an_images_mask_joins_that_of_all_images() -> None:
    frontend = _frontend(mask=_half(slice(0, 100)))
    always = frontend.capacity.copy()
    frontend.track(0, texture(2), None, _half(slice(220, None)))
    frontend.extract(QUOTAS)
    u = frontend.buffer.pixels[:, 0]
    assert len(u) > 8 and (u > 99).all() and (u < 220).all()
    assert (frontend.capacity <= always).all() and (frontend.capacity[:, 3] == 0).all()
    frontend.track(1, texture(2), None)
    np.testing.assert_array_equal(frontend.capacity, always)


def test_a_mask_without_holes_changes_nothing() -> None:
    plain, masked = _frontend(), _frontend()
    for k, image in enumerate(_drift(5)):
        plain.track(k, image, np.eye(3))
        masked.track(k, image, np.eye(3), np.full((HEIGHT, WIDTH), 7, np.uint8))
        plain.extract(QUOTAS)
        masked.extract(QUOTAS)
    np.testing.assert_array_equal(plain.buffer.pixel_history, masked.buffer.pixel_history)
    np.testing.assert_array_equal(plain.capacity, masked.capacity)


def test_a_quite_masked_image_loses_everything_and_goes_on() -> None:
    frontend = _frontend()
    frontend.track(0, texture(2), None)
    frontend.extract(QUOTAS)
    assert frontend.track(1, texture(2), None, np.zeros((HEIGHT, WIDTH), np.uint8)).tracked == 0
    assert frontend.extract(QUOTAS) == 0
    frontend.track(2, texture(2), None)
    assert frontend.extract(QUOTAS) == 60


def test_a_mask_of_another_size_leaves_the_front_end_as_it_was() -> None:
    frontend = _frontend()
    frontend.track(0, texture(2), None)
    frontend.extract(QUOTAS)
    before = frontend.observations()
    with pytest.raises(DataError, match=r"mask .*320x240"):
        frontend.track(1, texture(2), None, np.zeros((10, 10), np.uint8))
    np.testing.assert_array_equal(frontend.observations().pixels, before.pixels)
    assert frontend.observations().stamp_ns == 0


def test_where_a_fisheye_has_no_inverse_there_are_no_features() -> None:
    """The corners of TUM-VI's images: undistorted they would lie at 89°, wherever they are."""
    lens = EquidistantCamera(256, 256, 95.5, 95.5, 127.5, 128.4, 0.0035, 0.0007, -0.002, 0.0002)
    frontend = Frontend(lens, settings(), 0)
    assert frontend.allowed is not None and 0.85 < frontend.allowed.mean() < 0.97
    rng = np.random.default_rng(0)
    image = rng.integers(0, 255, (256, 256)).astype(np.uint8)
    frontend.track(0, image, None)
    frontend.extract(CellQuotas(np.full((3, 4), 40, np.int64)))
    found = frontend.observations()
    assert len(found) > 50 and lens.invertible(found.pixels).all()
    assert np.abs(np.arctan(np.linalg.norm(found.normalized, axis=1))).max() < lens.max_angle
    mask = np.full((256, 256), 255, np.uint8)
    mask[:, :128] = 0
    half = Frontend(lens, settings(), 0, mask)
    assert half.allowed is not None
    np.testing.assert_array_equal(half.allowed, frontend.allowed & (mask != 0))
    assert _frontend().allowed is None
