"""The lens against the tracks: the finding."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from p2gd_fgo.doctor.flow import Pair
from p2gd_fgo.doctor.lens_fit import Candidate, Lens, LensFit, candidates
from p2gd_fgo.doctor.report import Finding, Value
from p2gd_fgo.geometry.camera import Camera

_MIN_PAIRS = 8
_WARNING, _FAULT = 0.02, 0.10
"""Share of the robust cost that another lens saves. Two parameters more save 0.1 % by chance."""

_SIGMAS, _FAULT_SIGMAS = 5.0, 2.0
"""Of the mean gain between pairs. A small gain must come from nearly all pairs: moving bodies win
as much for any lens; a large one may come from the few turns that hold a drive's evidence."""

_NAMED = 0.05  # a named lens may be this much worse than the free correction
_EDGE = 95.0  # percentile of the radii


@dataclass(frozen=True, slots=True, eq=False)
class LensVerdict:
    """The finding, and the lens that explains the tracks best."""

    finding: Finding
    lens: Lens


def check_tracks(pairs: Sequence[Pair], camera: Camera) -> LensVerdict:
    """Compare the calibrated lens with the usual mistakes and with a free radial correction."""
    fit = LensFit(pairs)
    calibrated = Lens(camera)
    if len(fit.pairs) < _MIN_PAIRS:
        value = f"only {len(fit.pairs)} pairs of images with enough motion"
        finding = Finding("lens on tracks", "undetermined", value, f"≥ {_MIN_PAIRS} pairs")
        return LensVerdict(finding, calibrated)
    base = fit.costs(calibrated)
    corrected, covariance = fit.correct(camera)
    edge_px, sigma_px = _correction_px(corrected, covariance, fit.pairs)
    free = Candidate(corrected, "its coefficients don't fit")
    tried = [(c, fit.costs(c.lens)) for c in (*candidates(camera), free)]
    best, costs = min(tried, key=lambda item: item[1].sum() * (1 + _NAMED * (item[0] is free)))
    saved = base - costs
    share = float(saved.sum() / base.sum())
    z = float(saved.mean() / (saved.std(ddof=1) / np.sqrt(len(saved)) + 1e-12))
    threshold = (
        f"another lens fits better by < {100 * _WARNING:g} %, a fault beyond {100 * _FAULT:g} %"
    )
    data: dict[str, Value] = {
        "saved_share": share, "z": z, "pairs": len(fit.pairs),
        "edge_px": edge_px, "edge_sigma_px": sigma_px,
    }  # fmt: skip
    fault = share > _FAULT and z > _FAULT_SIGMAS
    if not fault and (share < _WARNING or z < _SIGMAS):
        value = (
            f"a free radial correction fits {100 * max(share, 0.0):.1f} % better and moves the "
            f"edge by {edge_px:.1f} ± {sigma_px:.1f} px"
        )
        return LensVerdict(Finding("lens on tracks", "ok", value, threshold, data=data), calibrated)
    value = f"wrong by the tracks, another fits {100 * share:.0f} % better: {best.meaning}"
    if best is free:
        value += f", the edge is {edge_px:.0f} ± {sigma_px:.0f} px off"
    finding = Finding(
        "lens on tracks",
        "fault" if fault else "warning",
        value,
        threshold,
        "correct distortion_model and distortion_coefficients, or calibrate anew",
        "distortion",
        data,
    )
    return LensVerdict(finding, best.lens)


def _correction_px(
    lens: Lens, covariance: np.ndarray, pairs: Sequence[Pair]
) -> tuple[float, float]:
    """By how many px the correction moves a track near the edge, and its sigma."""
    pixels = np.concatenate([pair.b for pair in pairs])
    plane = lens.camera.undistort(pixels)
    r = float(np.percentile(np.hypot(plane[:, 0], plane[:, 1]), _EDGE))
    d = lens.focal_px * np.array([r**3, r**5])
    return float(d @ lens.correction), float(np.sqrt(max(d @ covariance @ d, 0.0)))
