"""What predicted tracks are worth, and so the cells they begin in (paper III-B3)."""

from __future__ import annotations

import numpy as np

from p2gd_fgo.distribution.p2gd.predict import PredictedTracks
from p2gd_fgo.types import FloatArray, IntArray


def total_parallax(
    points: FloatArray, tracks: PredictedTracks, *, into_loss: bool = False
) -> FloatArray:
    """Sum of the angles between consecutive sightings, rotation compensated, rad (paper eq. 6).

    Turned into the next camera's frame, as eq. 6 writes it, or both into the world's: the angle
    between the two directions from camera to point is the same. It is computed from the chord
    between unit vectors, exact for small angles too.

    Parameters
    ----------
    points
        (P, 3) in the world.
    tracks
        Of these points.
    into_loss
        Whether the angle between the last image that sees the point and the one that loses it
        counts too: the letter of eq. 6 with a length "recorded as i".
    """
    rays = points.T - tracks.T_world_cam[:, :3, 3:]  # (H + 1, 3, P)
    rays /= np.sqrt(np.einsum("hip,hip->hp", rays, rays))[:, None]
    chord = rays[1:] - rays[:-1]
    half = 0.5 * np.sqrt(np.einsum("hip,hip->hp", chord, chord))
    angles = 2.0 * np.arcsin(np.minimum(half, 1.0)).T
    counted = tracks.visible[:, :-1] if into_loss else tracks.visible[:, 1:]
    return np.asarray(np.where(counted, angles, 0.0).sum(axis=1))


def track_length(tracks: PredictedTracks) -> FloatArray:
    """Predicted tracking length (P,): what total parallax leaves when angles don't count."""
    return tracks.lengths.astype(np.float64)


def cell_means(values: FloatArray, cells: IntArray, shape: tuple[int, int]) -> FloatArray:
    """Weights (rows, columns): the mean over a cell's points, 0 where there are none (eqs. 8, 9).

    Parameters
    ----------
    values
        (P,) of the points.
    cells
        (P,) flat index of the cell in the current image (eq. 7).
    shape
        (rows, columns).
    """
    size = shape[0] * shape[1]
    total = np.bincount(cells, weights=values, minlength=size)
    number = np.bincount(cells, minlength=size)
    return (total / np.maximum(number, 1)).reshape(shape)
