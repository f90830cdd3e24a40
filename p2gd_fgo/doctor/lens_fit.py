"""Whether the lens of the calibration explains the tracks, or another one would do better.

Epipolar geometry holds for undistorted points whatever the motion is, so its residual judges the
lens without gyro and truth. For each lens the motion of every pair is found anew; residuals are
Sampson distances brought back to pixels of the image by the lens' local magnification, so that a
lens that shrinks everything gains nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from p2gd_fgo.doctor.flow import Pair
from p2gd_fgo.doctor.two_view import MIN_POINTS, refine, sampson, two_view_motion
from p2gd_fgo.geometry import so3
from p2gd_fgo.geometry.camera import Camera, EquidistantCamera, RadTanCamera
from p2gd_fgo.types import FloatArray

_SCALE_PX = 0.5
_MISS_PX = 3.0  # what a point costs that a lens has no place for
_ROUNDS = 5
_STEP = 1e-4
_MIN_MOTION_PX = 3.0


@dataclass(frozen=True, slots=True, eq=False)
class Lens:
    """A camera, and a radial correction x (1 + a₁ r² + a₂ r⁴) of what it undistorts."""

    camera: Camera
    correction: tuple[float, float] = (0.0, 0.0)

    def undistort(self, pixels: FloatArray) -> FloatArray:
        """Points (N, 2) on z = 1 of pixels (N, 2)."""
        return bend(self.camera.undistort(pixels), np.array(self.correction))

    @property
    def focal_px(self) -> float:
        """Mean focal length."""
        return float(np.sqrt(self.camera.fx * self.camera.fy))


def bend(points: FloatArray, correction: FloatArray) -> FloatArray:
    """Points (N, 2) with a radial correction (2,)."""
    r2 = np.einsum("ni,ni->n", points, points)[:, None]
    return np.asarray(points * (1.0 + r2 * (correction[0] + r2 * correction[1])))


@dataclass(frozen=True, slots=True, eq=False)
class Candidate:
    """Another lens and, in words, what it would mean."""

    lens: Lens
    meaning: str


def candidates(camera: Camera) -> list[Candidate]:
    """Lenses that a calibration file means when it says something else."""
    pinhole = (camera.width, camera.height, camera.fx, camera.fy, camera.cx, camera.cy)
    names = [field.name for field in fields(camera)[6:]]
    k = [float(getattr(camera, name)) for name in names]
    if not any(k):
        return []
    straight = RadTanCamera(*pinhole, 0.0, 0.0, 0.0, 0.0)
    opposite = type(camera)(*pinhole, *(-value for value in k))
    radtan = isinstance(camera, RadTanCamera)
    model = EquidistantCamera if radtan else RadTanCamera
    other = model(*pinhole, *k[:4])
    article = "an equidistant" if radtan else "a radtan"
    return [
        Candidate(Lens(straight), "there is none, the images are rectified already"),
        Candidate(Lens(opposite), "the coefficients' signs are the wrong way round"),
        Candidate(Lens(other), f"the coefficients are those of {article} lens"),
    ]


class LensFit:
    """Judges lenses by the same pairs.

    Parameters
    ----------
    pairs
        Images some way apart; those with few points or little motion are left out.
    """

    def __init__(self, pairs: Sequence[Pair]) -> None:
        self.pairs = [
            pair
            for pair in pairs
            if len(pair.a) >= 2 * MIN_POINTS
            and np.median(np.linalg.norm(pair.a - pair.b, axis=1)) > _MIN_MOTION_PX
        ]

    def costs(self, lens: Lens) -> FloatArray:
        """Robust sum of squared residuals of every pair, (P,)."""
        return np.array([self._cost(pair, lens) for pair in self.pairs])

    def _cost(self, pair: Pair, lens: Lens) -> float:
        worst = float(np.log1p((_MISS_PX / _SCALE_PX) ** 2))
        good = lens.camera.invertible(pair.a) & lens.camera.invertible(pair.b)
        missed = worst * float((~good).sum())
        a, b = pair.a[good], pair.b[good]
        x1, x2 = lens.undistort(a), lens.undistort(b)
        motion = two_view_motion(x1, x2, lens.focal_px)
        if motion is None:
            return missed + worst * len(x1)
        R = so3.exp(-motion.phi)
        r, _ = sampson(x1, x2, R, motion.direction)
        px = r * _magnification(lens, b)
        return missed + float(np.log1p((px / _SCALE_PX) ** 2).sum())

    def correct(self, camera: Camera) -> tuple[Lens, FloatArray]:
        """The radial correction that the tracks ask for, and its covariance (2, 2).

        Gauss-Newton on all pairs, each pair's motion eliminated by a Schur complement; the
        covariance is from the scatter between pairs.
        """
        focal = Lens(camera).focal_px
        a = np.zeros(2)
        motions: dict[int, tuple[FloatArray, FloatArray]] = {}
        plane = [(camera.undistort(pair.a), camera.undistort(pair.b)) for pair in self.pairs]
        H, scores = np.zeros((2, 2)), np.zeros((0, 2))
        for _ in range(_ROUNDS):
            H, made = np.zeros((2, 2)), []
            for k, (u1, u2) in enumerate(plane):
                x1, x2 = bend(u1, a), bend(u2, a)
                if k not in motions:
                    motion = two_view_motion(x1, x2, focal)
                    if motion is None:
                        continue
                    motions[k] = so3.exp(-motion.phi), motion.direction
                motions[k] = refine(x1, x2, *motions[k], _SCALE_PX / focal)
                H_k, g_k = self._normal_equations((u1, u2), a, *motions[k], _SCALE_PX / focal)
                H += H_k
                made.append(g_k)
            if not made:
                return Lens(camera), np.full((2, 2), np.inf)
            scores = np.array(made)
            H += 1e-6 * np.eye(2)
            a = a - np.linalg.solve(H, scores.sum(axis=0))
        inverse = np.linalg.inv(H)
        return Lens(camera, (float(a[0]), float(a[1]))), inverse @ (scores.T @ scores) @ inverse

    def _normal_equations(
        self,
        plane: tuple[FloatArray, FloatArray],
        a: FloatArray,
        R: FloatArray,
        t: FloatArray,
        scale: float,
    ) -> tuple[FloatArray, FloatArray]:
        r, J = sampson(bend(plane[0], a), bend(plane[1], a), R, t)
        columns = []
        for step in _STEP * np.eye(2):
            plus, _ = sampson(bend(plane[0], a + step), bend(plane[1], a + step), R, t)
            minus, _ = sampson(bend(plane[0], a - step), bend(plane[1], a - step), R, t)
            columns.append((plus - minus) / (2.0 * _STEP))
        A = np.stack(columns, axis=1)
        w = 1.0 / (1.0 + (r / scale) ** 2) / scale**2
        JT, AT = (J * w[:, None]).T, (A * w[:, None]).T
        S = np.linalg.solve(JT @ J + 1e-6 * np.eye(5), JT @ A)
        return AT @ A - (AT @ J) @ S, AT @ r - S.T @ (JT @ r)


def _magnification(lens: Lens, pixels: FloatArray) -> FloatArray:
    """Pixels per unit on the plane z = 1 where the lens puts the pixels (N, 2)."""
    plain = lens.camera.undistort(pixels)
    J = lens.camera.distort_jacobian(plain)
    area = np.abs(np.linalg.det(J))
    a1, a2 = lens.correction
    r2 = np.einsum("ni,ni->n", plain, plain)
    across = 1.0 + r2 * (a1 + r2 * a2)
    along = 1.0 + r2 * (3.0 * a1 + 5.0 * r2 * a2)
    return np.asarray(np.sqrt(area / np.maximum(np.abs(across * along), 1e-6)))
