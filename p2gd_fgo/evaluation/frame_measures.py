"""What an image of a run had to go on: a line of numbers each, for the file ``frames.csv``."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from p2gd_fgo.errors import DataError
from p2gd_fgo.geometry.pose import covered, interpolate
from p2gd_fgo.recorder import RunResult
from p2gd_fgo.types import (
    NANOSECONDS,
    BoolArray,
    FloatArray,
    IntArray,
    TrackRecord,
    Trajectory,
)

FAR_M = 60.0
"""Beyond this P2GD believes no point (``scene.max_depth``), so that no quota is given for it."""

LONG = 10
"""Images of a long track."""

_LEAST_PARALLAX_RAD = np.radians(0.1)  # below this an angle is noise of the corners


def frame_measures(
    result: RunResult, poses: Trajectory, T_imu_cam: FloatArray
) -> dict[str, FloatArray]:
    """Measure each of the F images of a run.

    Parameters
    ----------
    result
        The run.
    poses
        Of the IMU, from the truth if there is any: the far tracks are told by it.
    T_imu_cam
        (4, 4) takes camera points to the IMU frame.

    Returns
    -------
    dict
        (F,) each, NaN where unknown. ``features``; ``new``: seen for the first time; ``asked``,
        ``served``: the quota, and as much of it as there were features; ``tracks_3``,
        ``tracks_10``: features seen in so many images, this one included; ``far``: those of 10
        images and more that lie beyond 60 m, see :func:`far_tracks`; ``outliers``: tracks against
        the motion of the rest; ``gated``: observations that the back end's gates rejected;
        ``still``: 1 where taken as standing still; ``accel_m_s2``: change of the estimated velocity
        since the image before, over the time.
    """
    record = result.tracks
    image, age, _ = _ages(record)
    frames = len(record.stamps_ns)

    def number(which: BoolArray) -> FloatArray:
        return np.bincount(image[which], minlength=frames).astype(np.float64)

    at = np.searchsorted(record.stamps_ns, result.estimate.stamps_ns)
    still, accel = np.full(frames, np.nan), np.full(frames, np.nan)
    still[at] = result.still
    if len(at) > 1:
        seconds = np.diff(result.estimate.stamps_ns) / NANOSECONDS
        accel[at[1:]] = np.linalg.norm(np.diff(result.velocities, axis=0), axis=1) / seconds
    return {
        "features": record.counts.astype(np.float64),
        "new": number(age == 1),
        "asked": record.asked.astype(np.float64),
        "served": np.minimum(record.asked, record.counts).astype(np.float64),
        "tracks_3": number(age >= 3),
        "tracks_10": number(age >= LONG),
        "far": far_tracks(record, poses, T_imu_cam),
        "outliers": result.outliers.astype(np.float64),
        "gated": result.gated.astype(np.float64),
        "still": still,
        "accel_m_s2": accel,
    }


def far_tracks(
    record: TrackRecord, poses: Trajectory, T_imu_cam: FloatArray, far_m: float = FAR_M
) -> FloatArray:
    """Features (F,) in each image that were seen in 10 images and more and lie beyond ``far_m``.

    By the triangle of the point and the camera at this image and nine sightings before: its
    distance is ‖t × d₀‖ / sin θ, with the way t between them, the ray d₀ of the first and the angle
    θ between the rays in the world, 0.1° at least. NaN where the poses don't cover the image; a
    track whose poses aren't known at both isn't counted.
    """
    frames = len(record.stamps_ns)
    known = covered(poses, record.stamps_ns)
    if not known.any():
        return np.full(frames, np.nan)
    T = interpolate(poses, record.stamps_ns) @ T_imu_cam
    image, age, order = _ages(record)
    last = np.flatnonzero(age >= LONG)
    first = last - (LONG - 1)
    i, j = image[first], image[last]
    usable = known[i] & known[j]
    i, j, first, last = i[usable], j[usable], first[usable], last[usable]
    rays = np.concatenate([record.normalized[order], np.ones((len(order), 1))], axis=1)
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    d0, d1 = ((T[n, :3, :3] @ rays[k, :, None])[:, :, 0] for n, k in ((i, first), (j, last)))
    t = T[j, :3, 3] - T[i, :3, 3]
    across = np.linalg.norm(np.cross(t, d0), axis=1)
    sine = np.linalg.norm(np.cross(d0, d1), axis=1)
    far = across > far_m * np.maximum(sine, np.sin(_LEAST_PARALLAX_RAD))
    return np.where(known, np.bincount(j[far], minlength=frames), np.nan)


def read_frames(path: Path) -> tuple[IntArray, dict[str, FloatArray]]:
    """Read ``frames.csv``: stamps (F,) and the columns (F,), NaN where empty.

    Raises
    ------
    DataError
        The file is missing or not such a table.
    """
    try:
        header, *lines = path.read_text(encoding="utf-8").splitlines()
        rows = [line.split(",") for line in lines]
        stamps = np.array([int(row[0]) for row in rows], dtype=np.int64)
        values = np.array(
            [[float(cell) if cell else np.nan for cell in row[1:]] for row in rows]
        ).reshape(len(rows), -1)
        names = header.split(",")[1:]
        return stamps, {name: values[:, k] for k, name in enumerate(names)} if len(rows) else {}
    except FileNotFoundError:
        raise DataError(
            f"{path}: no such file; runs made before it was kept have to be made again"
        ) from None
    except (OSError, ValueError, IndexError) as error:
        raise DataError(f"{path}: no table of images: {error}") from None


def _ages(record: TrackRecord) -> tuple[IntArray, IntArray, IntArray]:
    """Image and age (M,) of every sighting, sorted by track, and the order that sorts them."""
    image = np.repeat(np.arange(len(record.stamps_ns)), record.counts)
    order = np.argsort(record.ids, kind="stable")
    ids = record.ids[order]
    starts = np.flatnonzero(np.r_[True, ids[1:] != ids[:-1]]) if len(ids) else np.zeros(0, int)
    lengths = np.diff(np.r_[starts, len(ids)])
    age = np.arange(len(ids)) - np.repeat(starts, lengths) + 1
    return image[order], age, order
