"""How well features were tracked: length and parallax, by track (paper, IV) and by image."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, Literal

import numpy as np

from p2gd_fgo.geometry.pose import covered, interpolate
from p2gd_fgo.types import BoolArray, FloatArray, IntArray, TrackRecord, Trajectory

RotationSource = Literal["truth", "estimate"]
LENGTHS = (1, 5, 10, 15, 20)
"""Track lengths whose shares are counted (paper Table II)."""

_EACH_IMAGE_LENGTHS = (3, 10)


@dataclass(frozen=True, slots=True, eq=False)
class CameraRotations:
    """How the camera was turned at F images.

    Attributes
    ----------
    source
        Where the rotations come from.
    known
        (F,) whether the source covers the image.
    R_world_cam
        (F, 3, 3); means nothing where not known.
    """

    source: RotationSource
    known: BoolArray
    R_world_cam: FloatArray


@dataclass(frozen=True, slots=True)
class TrackingQuality:
    """Tracking measures of a run; NaN where there is nothing to divide by.

    All tracks count: those of a single image, with parallax 0, and those still alive at the last
    image. Parallax measures are of the images whose rotation is known alone.

    Attributes
    ----------
    rotations
        What compensated the rotation.
    frames, tracks
        Images, and tracks in them.
    mean_length
        Images per track.
    length_shares
        Share of the tracks that have exactly this length, 0 to 1.
    total_parallax_deg
        Mean over tracks of the sum of the angles between consecutive bearings (paper eq. 6).
    two_view_parallax_deg
        Sum of all tracks' total parallax over the sum of their lengths.
    total_parallax_per_frame_deg
        Sum of all angles over the number of images.
    features_per_frame
        Observations over images.
    tracks_3_per_frame, tracks_10_per_frame
        Tracks that reached this length, over images.
    quota_asked_per_frame, quota_served_per_frame
        Features that the distribution wanted; as many of them as there were, at most all.
    frames_without_rotation, pairs_left_out
        Images without a known rotation; pairs of consecutive bearings that they touch.
    """

    rotations: RotationSource
    frames: int
    tracks: int
    mean_length: float
    length_shares: Mapping[int, float]
    total_parallax_deg: float
    two_view_parallax_deg: float
    total_parallax_per_frame_deg: float
    features_per_frame: float
    tracks_3_per_frame: float
    tracks_10_per_frame: float
    quota_asked_per_frame: float
    quota_served_per_frame: float
    frames_without_rotation: int
    pairs_left_out: int

    @property
    def single_frame_share(self) -> float:
        """Share of the tracks that were seen in one image only, 0 to 1."""
        return self.length_shares[1]

    def to_json(self) -> dict[str, Any]:
        """Plain data: every attribute, and ``single_frame_share``."""
        return asdict(self) | {"single_frame_share": self.single_frame_share}


def camera_rotations(
    stamps_ns: IntArray, truth: Trajectory | None, estimate: Trajectory, T_imu_cam: FloatArray
) -> CameraRotations:
    """Rotations from the truth if it covers any of the images, else from the estimate.

    Parameters
    ----------
    stamps_ns
        (F,) of the images.
    truth, estimate
        Covered is what lies inside them and in no hole longer than 0.5 s.
    T_imu_cam
        (4, 4) takes camera points to the IMU frame.
    """
    source: RotationSource = "estimate"
    trajectory, known = estimate, covered(estimate, stamps_ns)
    if truth is not None and (by_truth := covered(truth, stamps_ns)).any():
        source, trajectory, known = "truth", truth, by_truth
    R_world_cam = np.tile(np.eye(3), (len(stamps_ns), 1, 1))
    if known.any():
        R_world_imu = interpolate(trajectory, stamps_ns)[:, :3, :3]
        R_world_cam = R_world_imu @ T_imu_cam[:3, :3]
    return CameraRotations(source, known, R_world_cam)


def tracking_quality(record: TrackRecord, rotations: CameraRotations) -> TrackingQuality:
    """Measure the tracks of a run.

    Parameters
    ----------
    record
        F images and the M features seen in them.
    rotations
        At the same F images.
    """
    frames = len(record.stamps_ns)
    image = np.repeat(np.arange(frames), record.counts)
    by_track = np.argsort(record.ids, kind="stable")  # inside a track the images stay in order
    ids, image, points = record.ids[by_track], image[by_track], record.normalized[by_track]
    lengths = np.unique(ids, return_counts=True)[1]

    known = rotations.known[image]
    bearings = np.concatenate([points, np.ones((len(points), 1))], axis=1)
    in_world = (rotations.R_world_cam[image] @ bearings[:, :, None])[:, :, 0]
    pair = ids[1:] == ids[:-1]
    measured = pair & known[1:] & known[:-1]
    total_deg = float(np.degrees(angles(in_world[:-1][measured], in_world[1:][measured]).sum()))

    tracks = len(lengths)
    frames_known = int(rotations.known.sum())
    reached = {n: _ratio(int((lengths >= n).sum()), frames) for n in _EACH_IMAGE_LENGTHS}
    return TrackingQuality(
        rotations=rotations.source,
        frames=frames,
        tracks=tracks,
        mean_length=_ratio(len(ids), tracks),
        length_shares={n: _ratio(int((lengths == n).sum()), tracks) for n in LENGTHS},
        total_parallax_deg=_ratio(total_deg, len(np.unique(ids[known]))),
        two_view_parallax_deg=_ratio(total_deg, int(known.sum())),
        total_parallax_per_frame_deg=_ratio(total_deg, frames_known),
        features_per_frame=_ratio(len(ids), frames),
        tracks_3_per_frame=reached[3],
        tracks_10_per_frame=reached[10],
        quota_asked_per_frame=_ratio(int(record.asked.sum()), frames),
        quota_served_per_frame=_ratio(int(np.minimum(record.asked, record.counts).sum()), frames),
        frames_without_rotation=frames - frames_known,
        pairs_left_out=int(pair.sum() - measured.sum()),
    )


def angles(a: FloatArray, b: FloatArray) -> FloatArray:
    """Angle (N,) in rad between vectors a and b (N, 3) of any length but 0.

    By the arc tangent: the arc cosine of eq. (6) is blind below 1e-8 rad and returns NaN where
    rounding takes the cosine beyond 1.
    """
    cross = np.linalg.norm(np.cross(a, b), axis=1)
    return np.asarray(np.arctan2(cross, (a * b).sum(axis=1)))


def _ratio(amount: float, number: int) -> float:
    return amount / number if number else float("nan")
