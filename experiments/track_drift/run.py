"""Is a track's error white? Prints a table in markdown, a row for each length of track.

Tracks of whole runs are triangulated with the poses of truth, by least squares, and what is left
of each sighting is looked at from image to image.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

from p2gd_fgo.backends.msckf.state import Poses
from p2gd_fgo.backends.msckf.tracks import Sightings
from p2gd_fgo.backends.msckf.triangulation import triangulate
from p2gd_fgo.cli.options import read_settings
from p2gd_fgo.cli.refusing import run_refusing
from p2gd_fgo.config import load_config, override
from p2gd_fgo.datasets import open_sequence
from p2gd_fgo.errors import DataError
from p2gd_fgo.geometry.pose import interpolate
from p2gd_fgo.pipeline import run_sequence
from p2gd_fgo.types import FloatArray, IntArray

CLASSES = ((4, 6), (7, 9), (10, 14), (15, 20))
LEAST_DEPTH_M = 0.5
MOST_RAD = 0.02  # an RMS beyond is a mistracked point, and no drift
LEAST_INFORMATION = 1e-5  # of a point in its worst direction against its best
STEPS = 5


def residuals(sightings: FloatArray, T_world_cam: FloatArray) -> tuple[FloatArray, FloatArray]:
    """What least squares leaves of tracks of one length.

    Parameters
    ----------
    sightings
        (N, V, 2) on the plane z = 1.
    T_world_cam
        (N, V, 4, 4) of each sighting.

    Returns
    -------
    tuple[FloatArray, FloatArray]
        (M, V, 2) of the tracks that have a point, and (M, 2 V, 2 V) the projections that take
        errors of sightings to them.
    """
    R, c = T_world_cam[..., :3, :3], T_world_cam[..., :3, 3]
    N, V = sightings.shape[:2]
    table = Sightings.of_table(sightings, np.zeros(N, np.int64), V)
    each = replace(table, view=np.arange(N * V))  # every sighting has a camera of its own
    points = triangulate(each, Poses(R.reshape(-1, 3, 3), c.reshape(-1, 3)), STEPS)
    local = (np.swapaxes(R, 2, 3) @ (points.position[:, None] - c)[..., None])[..., 0]
    usable = points.in_front & (local[..., 2] > LEAST_DEPTH_M).all(axis=1)
    z = np.maximum(local[..., 2], LEAST_DEPTH_M)
    r = sightings - local[..., :2] / z[..., None]
    by_point = np.zeros((N, V, 2, 3))
    by_point[..., 0, 0] = by_point[..., 1, 1] = 1.0 / z
    by_point[..., 2] = -local[..., :2] / z[..., None] ** 2
    J = (by_point @ np.swapaxes(R, 2, 3)).reshape(N, 2 * V, 3)
    singular = np.linalg.svd(J, compute_uv=False)
    usable &= singular[:, 2] ** 2 > LEAST_INFORMATION * singular[:, 0] ** 2
    usable &= np.sqrt((r**2).mean(axis=(1, 2))) < MOST_RAD
    Q = np.eye(2 * V) - J @ np.linalg.pinv(J, rcond=1e-9)
    return r[usable], Q[usable]


def variances(r: FloatArray, Q: FloatArray) -> FloatArray:
    """(M, 2) of the errors, were they white: by their size, and by their change image to image."""
    V = r.shape[1]
    D = np.kron(np.eye(V)[1:] - np.eye(V)[:-1], np.eye(2))
    change = D @ r.reshape(len(r), 2 * V, 1)
    size = (r**2).sum(axis=(1, 2)) / np.trace(Q, axis1=1, axis2=2)
    walk = (change**2).sum(axis=(1, 2)) / np.trace(D @ Q @ D.T, axis1=1, axis2=2)
    return np.column_stack([size, walk])


def measure(folder: Path, settings: dict[str, object]) -> list[tuple[str, int, FloatArray]]:
    """Class of length, number of tracks, and the medians of their two variances, px²."""
    fixed = {
        "dataset.path": str(folder),
        "initialization.kind": "given",
        "backend.kind": "dead_reckoning",
    }
    config = override(load_config(), {**fixed, **settings})
    sequence = open_sequence(config.dataset)
    if sequence.truth is None:
        raise DataError(f"{folder}: has no truth, and this needs its poses")
    tracks = run_sequence(sequence, config).tracks
    image = np.repeat(np.arange(len(tracks.counts)), tracks.counts)
    T = interpolate(sequence.truth.trajectory, tracks.stamps_ns) @ sequence.calibration.T_imu_cam
    order = np.lexsort((image, tracks.ids))
    first = np.flatnonzero(np.diff(tracks.ids[order], prepend=-1))
    lengths: IntArray = np.diff(first, append=len(order))
    focal = float(np.sqrt(sequence.calibration.camera.fx * sequence.calibration.camera.fy))
    found = []
    for low, high in CLASSES:
        parts = []
        for length in range(low, high + 1):
            rows = order[first[lengths == length][:, None] + np.arange(length)]
            if len(rows) > 0:
                parts.append(variances(*residuals(tracks.normalized[rows], T[image[rows]])))
        both = np.concatenate(parts) if parts else np.zeros((0, 2))
        if len(both) > 0:
            found.append((f"{low}-{high}", len(both), focal**2 * np.median(both, axis=0)))
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folders", nargs="+", type=Path, help="recordings with truth")
    parser.add_argument("--set", action="append", default=[], metavar="FIELD=VALUE")
    options = parser.parse_args()
    settings = read_settings(options.set)
    write = sys.stdout.write
    write("| recording | anchor | images | tracks | size px | change px | ratio |\n")
    write("|---|---|---|---|---|---|---|\n")
    for folder in options.folders:
        for anchor in (False, True):
            for name, count, (size, change) in measure(
                folder, {**settings, "frontend.anchor": anchor}
            ):
                write(
                    f"| {folder.name} | {'yes' if anchor else 'no'} | {name} | {count} "
                    f"| {np.sqrt(size):.3f} | {np.sqrt(change):.3f} | {size / change:.1f} |\n"
                )
            sys.stdout.flush()


if __name__ == "__main__":
    run_refusing(main)
