"""Smart projection factors of the tracks seen in the window, and the account of observations.

Each observation is in exactly one factor. When the oldest image leaves, the factors that saw it
are taken out whole (folded into the prior); if such a track is seen again, its later sightings
start a factor of their own. So an observation is marginalised or reused, never both, and lost
only when a gate rejected it, which is counted.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field

import gtsam
from gtsam.symbol_shorthand import X

from p2gd_fgo.backends.gate import track_gate
from p2gd_fgo.backends.smoother.lens import SmartFactor, measured_lens
from p2gd_fgo.config import SmootherConfig
from p2gd_fgo.geometry.camera import Camera
from p2gd_fgo.types import FloatArray, Observations

# Singular value of GTSAM's linear triangulation below which a track is not used: about focal
# length times spread of the cameras. With less baseline, pixel noise decides the depth of a
# point: the estimate of a vehicle that slows down becomes overconfident, and its window singular.
_LEAST_BASELINE_PX_M = 50.0

# Of so many tracks or more the majority is right: where most fail the gate, the state is wrong.
_JURY = 10

_STATUS_NAMES = {
    gtsam.TriangulationResult.Status.DEGENERATE: "rejected_degenerate",
    gtsam.TriangulationResult.Status.BEHIND_CAMERA: "rejected_behind_camera",
    gtsam.TriangulationResult.Status.OUTLIER: "rejected_outlier",
    gtsam.TriangulationResult.Status.FAR_POINT: "rejected_far",
}


@dataclass(slots=True, eq=False)
class Track:
    """One landmark's sightings: the factor and the frame numbers in it."""

    factor: SmartFactor
    frames: list[int] = field(default_factory=list)


class TrackFactors:
    """The live factors.

    Attributes
    ----------
    counts
        Observations by fate.
    gate_opened
        Times that the gate was.

    Residuals are pixels of the image, through its lens (:mod:`p2gd_fgo.backends.smoother.lens`).
    """

    def __init__(
        self, camera: Camera, T_imu_cam: FloatArray, pixel_noise_px: float, config: SmootherConfig
    ) -> None:
        self._lens = measured_lens(camera)
        self._noise = gtsam.noiseModel.Isotropic.Sigma(2, pixel_noise_px)
        self._body_P_cam = gtsam.Pose3(T_imu_cam)
        params = gtsam.SmartProjectionParams(
            gtsam.LinearizationMode.HESSIAN,
            gtsam.DegeneracyMode.ZERO_ON_DEGENERACY,
            False,  # throw on points behind the camera
            False,  # verbose
            1e-3,  # retriangulate when the cameras moved by more than this
        )
        params.setRankTolerance(_LEAST_BASELINE_PX_M)
        params.setLandmarkDistanceThreshold(config.landmark_distance)
        params.setDynamicOutlierRejectionThreshold(config.outlier_px)
        self._params = params
        self._gate = config.gate_probability
        self._tracks: dict[int, Track] = {}
        self._starting_at: dict[int, list[int]] = {}  # frame to the ids of the tracks that begin
        self.counts: Counter[str] = Counter()
        self.gate_opened = 0

    def add(self, observations: Observations, frame: int) -> None:
        """Sightings of an image, frame being its number."""
        measured = self._lens.measurements(observations.pixels, observations.normalized)
        key = X(frame)
        for track_id, z in zip(observations.ids.tolist(), measured, strict=True):
            track = self._tracks.get(track_id)
            if track is None:
                track = Track(self._lens.make_factor(self._noise, self._body_P_cam, self._params))
                self._tracks[track_id] = track
                self._starting_at.setdefault(frame, []).append(track_id)
            track.factor.add(z, key)
            track.frames.append(frame)

    def usable(
        self, frame: int, values: gtsam.Values
    ) -> tuple[gtsam.NonlinearFactorGraph, gtsam.NonlinearFactorGraph]:
        """Factors of two sightings or more: those seen in ``frame``, and those that are not.

        What doesn't pass the gate at ``values`` is left out this time, and may pass the next. GTSAM
        has only a limit in pixels, too wide for a short track: while the vehicle has hardly moved
        since the start, what is mistracked looks near and is all that can be triangulated, and two
        such tracks can stop a vehicle whose speed is known to a tenth.

        The gate doesn't know how uncertain ``values`` are. After an uncertain start or a long hole
        it would leave out every track, and the state would stay wrong for want of them; so it is
        open where most of the tracks fail it (counted as ``gate_opened``).
        """
        seen = [track for track in self._tracks.values() if len(track.frames) > 1]
        passing = [self._passes(track, values) for track in seen]
        failed = passing.count(False)
        if failed >= _JURY and 2 * failed > sum(t.factor.point(values).valid() for t in seen):
            self.gate_opened += 1
            passing = [True] * len(seen)
        live, settled = gtsam.NonlinearFactorGraph(), gtsam.NonlinearFactorGraph()
        for track, passes in zip(seen, passing, strict=True):
            if passes:
                (live if track.frames[-1] == frame else settled).push_back(track.factor)
        return live, settled

    def take_starting_at(self, frame: int) -> list[Track]:
        """Remove and return the tracks whose first sighting is ``frame``."""
        return [self._tracks.pop(i) for i in self._starting_at.pop(frame, [])]

    def accept(self, tracks: list[Track], values: gtsam.Values) -> list[Track]:
        """Those that may enter the prior; the others are counted under the gate's name."""
        accepted = []
        for track in tracks:
            verdict = self._verdict(track, values)
            self.counts[verdict] += len(track.frames)
            if verdict == "marginalized":
                accepted.append(track)
        return accepted

    def drop_those_behind(self, values: gtsam.Values) -> bool:
        """Let go the tracks whose point has come behind a camera since GTSAM last looked.

        It triangulates anew only when cameras have moved by more than a millimetre or so. A point
        just before a camera may lie behind it then, and GTSAM throws on it, asked not to or not.

        Returns
        -------
        bool
            Whether there was one.
        """
        behind = []
        for track_id, track in self._tracks.items():
            try:
                if len(track.frames) > 1:
                    track.factor.linearize(values)
            except RuntimeError:
                behind.append(track_id)
        for track_id in behind:
            track = self._tracks.pop(track_id)
            self._starting_at[track.frames[0]].remove(track_id)
            self.counts["rejected_behind_camera"] += len(track.frames)
        return bool(behind)

    def live_observations(self) -> int:
        """Sightings that are in the window's factors."""
        return sum(len(t.frames) for t in self._tracks.values())

    def _verdict(self, track: Track, values: gtsam.Values) -> str:
        n = len(track.frames)
        if n < 2:
            return "single_view"
        result = track.factor.point(values)
        if not result.valid():
            return _STATUS_NAMES[result.status]
        return "marginalized" if self._passes(track, values) else "rejected_chi_square"

    def _passes(self, track: Track, values: gtsam.Values) -> bool:
        """The chi-square gate of n > 1 sightings; what GTSAM finds invalid has no error."""
        # error() is half the squared Mahalanobis norm.
        gate = track_gate(self._gate, len(track.frames))
        return 2.0 * track.factor.error(values) < gate
