"""Which parts of a recording to look at: those whose rotation says most."""

from __future__ import annotations

import numpy as np

from p2gd_fgo.doctor.intervals import GyroIntegral
from p2gd_fgo.types import FloatArray, IntArray

IMAGES = 300
"""Images looked at, at most: enough for an offset in time to a millisecond, in about 10 s."""

LENGTH = 30
"""Images of one stretch."""


def choose_stretches(image_s: FloatArray, gyro: GyroIntegral) -> list[IntArray]:
    """Runs of consecutive image numbers, in order, that don't overlap.

    Greedy choice of the stretch that adds most to the determinant of the summed scatter of the
    rotation between images (D-optimal design): all axes of rotation get their share, where the
    recording has them. Units and axes of the gyro don't matter to it.

    Parameters
    ----------
    image_s
        (N,) stamps on the scale of :meth:`GyroIntegral.seconds`.
    """
    count = len(image_s)
    if count <= IMAGES:
        return list(np.array_split(np.arange(count), max(count // LENGTH, 1)))
    theta = gyro.rotation(image_s[:-1], image_s[1:])
    theta = theta - np.median(theta, axis=0)
    parts = [np.arange(k, k + LENGTH) for k in range(0, count - LENGTH + 1, LENGTH)]
    scatter = np.stack([_scatter(theta[part[:-1]]) for part in parts])
    total = scatter.sum(axis=0)
    H = np.eye(3) * (1e-6 * np.trace(total) + 1e-12)
    chosen: list[int] = []
    for _ in range(min(IMAGES // LENGTH, len(parts))):
        gain = np.linalg.slogdet(H + scatter)[1]
        gain[chosen] = -np.inf
        best = int(np.argmax(gain))
        chosen.append(best)
        H = H + scatter[best]
    return [parts[k] for k in sorted(chosen)]


def _scatter(theta: FloatArray) -> FloatArray:
    centred = theta - theta.mean(axis=0)
    return np.asarray(centred.T @ centred)
