"""Everything that compares two sensors, and who of them is wrong."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from p2gd_fgo.config import Config
from p2gd_fgo.datasets import Sequence
from p2gd_fgo.doctor.axes import Axes
from p2gd_fgo.doctor.camera_gyro import CameraMatch, camera_rotations, match_camera
from p2gd_fgo.doctor.flow import FlowSample
from p2gd_fgo.doctor.intervals import GyroIntegral
from p2gd_fgo.doctor.lens_check import LensVerdict, check_tracks
from p2gd_fgo.doctor.lens_fit import Lens
from p2gd_fgo.doctor.report import Finding, Value
from p2gd_fgo.doctor.tolerances import Tolerances, make_tolerances
from p2gd_fgo.doctor.truth_accel import match_accel
from p2gd_fgo.doctor.truth_gyro import TruthMatch, match_truth
from p2gd_fgo.doctor.verdict_camera import FOCAL, focal_ratio, judge_camera
from p2gd_fgo.doctor.verdict_truth import judge_accel, judge_truth
from p2gd_fgo.types import NANOSECONDS, ImuBatch


def check_motion(
    sequence: Sequence,
    config: Config,
    gyro: GyroIntegral,
    sample: FlowSample,
    accel_factor: float,
) -> list[Finding]:
    """Compare images with the lens, images with the gyro, truth with gyro and accelerometer.

    Parameters
    ----------
    accel_factor
        What makes m/s² of the accelerometer's numbers.
    """
    truth = None if sequence.truth is None else match_truth(sequence.truth.trajectory, gyro)
    eyes = _Eyes(sequence, gyro, sample)
    verdict, camera = eyes.look(truth)
    gyro_axes = None
    said = _axes(truth)
    if said is not None and camera is not None:
        mended = eyes.match(verdict.lens, said)
        if mended is not None and _better(mended, camera):
            gyro_axes, camera = said, replace(mended, focal_factor=camera.focal_factor)
    tolerances = _tolerances(sequence, config, camera, truth)
    findings = [verdict.finding, *_gyro(truth, camera, gyro_axes)]
    seen = _camera_findings(sequence, camera, truth, gyro_axes, tolerances)
    guessed = verdict.finding.status == "fault"
    findings += [_provisional(finding) for finding in seen] if guessed else seen
    if truth is not None:
        findings += judge_truth(truth, tolerances, config, gyro_axes)
    if sequence.truth is not None and not (truth is not None and truth.inverted):
        imu = ImuBatch(sequence.imu.stamps_ns, sequence.imu.gyro, accel_factor * sequence.imu.accel)
        shift = truth.match.fit.shift_s if truth is not None and truth.match.explains else 0.0
        accel = match_accel(sequence.truth.trajectory, imu, config.imu.gravity, shift)
        if accel is not None:
            findings.append(judge_accel(accel))
    return _one_clock(findings, tolerances.shift_thresholds_s[0])


@dataclass(frozen=True, slots=True, eq=False)
class _Eyes:
    """The tracked images of a recording."""

    sequence: Sequence
    gyro: GyroIntegral
    sample: FlowSample

    def match(self, lens: Lens, gyro_axes: Axes | None) -> CameraMatch | None:
        calibration = self.sequence.calibration
        intervals = camera_rotations(
            self.sample.pairs, lens, self.sequence.image_stamps_ns, self.gyro
        )
        return match_camera(
            intervals,
            self.gyro,
            calibration.T_imu_cam[:3, :3],
            calibration.time_offset_s,
            gyro_axes,
        )

    def look(self, truth: TruthMatch | None) -> tuple[LensVerdict, CameraMatch | None]:
        """The lens' verdict, and the match with the lens that explains the tracks.

        A wrong focal length bends the epipolar geometry and the axes of the rotation too: where
        the gyro asks for another one, and the calibrated coefficients explain the tracks with it,
        everything else is judged with it.
        """
        camera = self.sequence.calibration.camera
        verdict = check_tracks(self.sample.chains, camera)
        plain = self.match(Lens(camera), None)
        if plain is not None and plain.match.explains:
            ratio = focal_ratio(plain.scale, _gyro_scale(truth))
            if abs(np.log(ratio)) > FOCAL:
                scaled = replace(camera, fx=camera.fx * ratio, fy=camera.fy * ratio)
                again = check_tracks(self.sample.chains, scaled)
                refit = self.match(Lens(scaled), None)
                if again.finding.status in ("ok", "undetermined") and refit is not None:
                    acquitted = LensVerdict(again.finding, Lens(scaled))
                    return acquitted, replace(refit, focal_factor=ratio)
        if verdict.finding.status not in ("warning", "fault"):
            return verdict, plain
        return verdict, self.match(verdict.lens, None)


def _better(mended: CameraMatch, recorded: CameraMatch) -> bool:
    """Whether the images agree with the truth about the gyro's axes."""
    if mended.match.hypothesis.kind != "expected":
        return False
    if recorded.match.hypothesis.kind != "expected":
        return True
    return mended.match.fit.cost < recorded.match.fit.cost - recorded.match.gate


def _axes(truth: TruthMatch | None) -> Axes | None:
    if truth is None or not truth.match.explains:
        return None
    return truth.match.hypothesis.axes


def _gyro_scale(truth: TruthMatch | None) -> float:
    return truth.match.scale if truth is not None and truth.match.explains else 1.0


def _tolerances(
    sequence: Sequence, config: Config, camera: CameraMatch | None, truth: TruthMatch | None
) -> Tolerances:
    step_s = float(np.median(np.diff(sequence.image_stamps_ns))) / NANOSECONDS
    imu_step_s = float(np.median(np.diff(sequence.imu.stamps_ns))) / NANOSECONDS
    model = sequence.calibration.camera
    if camera is not None:
        phi, length_s = camera.phi, step_s
    elif truth is not None:
        phi, length_s = truth.phi, truth.length_s
    else:
        phi, length_s = np.zeros((1, 3)), step_s
    rate_of = phi * (step_s / length_s)
    return make_tolerances(config, float(np.sqrt(model.fx * model.fy)), rate_of, step_s, imu_step_s)


def _gyro(
    truth: TruthMatch | None, camera: CameraMatch | None, gyro_axes: Axes | None
) -> list[Finding]:
    """Units and axes of the gyro, where images or truth tell."""
    matches = [found.match for found in (camera, truth) if found is not None]
    matches = [found for found in matches if found.explains]
    if not matches:
        return []
    units = {found.unit for found in matches}
    threshold = "rad/s, the axes of the IMU"
    data: dict[str, Value] = {"unit": ", ".join(sorted(units))}
    if "rad/s" not in units:
        unit = matches[0].unit
        mend = "multiply the gyro by π/180" if unit == "deg/s" else "multiply the gyro by 180/π"
        value = f"the gyro is in {unit}"
        return [Finding("gyro", "fault", value, threshold, mend, "gyro_units", data)]
    if gyro_axes is not None:
        value = f"gyro axes: {gyro_axes.describe()}, by images and by truth"
        mend = "mend the gyro's columns in the recording"
        return [Finding("gyro", "fault", value, threshold, mend, "gyro_axes", data)]
    bias = np.linalg.norm(matches[0].fit.bias)
    return [Finding("gyro", "ok", f"rad/s, bias about {bias:.3f} rad/s", threshold, data=data)]


def _camera_findings(
    sequence: Sequence,
    camera: CameraMatch | None,
    truth: TruthMatch | None,
    gyro_axes: Axes | None,
    tolerances: Tolerances,
) -> list[Finding]:
    if camera is None:
        value = "not determined: too few images could be followed"
        return [Finding("camera and gyro", "undetermined", value, "≥ 20 pairs of neighbours")]
    R = sequence.calibration.T_imu_cam[:3, :3].T
    if gyro_axes is not None:
        R = R @ gyro_axes.matrix
    vouched = (
        truth is not None
        and truth.match.explains
        and (truth.match.hypothesis.kind == "expected" or gyro_axes is not None)
    )
    return judge_camera(
        camera,
        R,
        sequence.calibration.time_offset_s,
        tolerances,
        gyro_vouched=vouched,
        gyro_scale=_gyro_scale(truth) if vouched else 1.0,
    )


def _provisional(finding: Finding) -> Finding:
    """A warning that was made with a guessed lens is worth a note; a fault stays one."""
    if finding.status != "warning":
        return finding
    value = f"{finding.value}, with a guessed lens"
    return replace(finding, status="note", value=value, fault=None)


def _one_clock(findings: list[Finding], tolerance_s: float) -> list[Finding]:
    """Where images and truth agree about time, it is the IMU that is late."""
    wrong = {f.fault: f for f in findings if f.fault in ("time_offset", "truth_time")}
    if len(wrong) < 2:
        return findings
    camera, truth = wrong["time_offset"], wrong["truth_time"]
    error = float(camera.data["offset_s"] or 0.0) - float(camera.data["configured_s"] or 0.0)
    shift = float(truth.data["shift_s"] or 0.0)
    if abs(error - shift) > tolerance_s:
        return findings
    value = f"images and truth agree that its stamps are {1e3 * error:+.1f} ms off"
    mend = f"subtract {error:.4f} s from the IMU's stamps"
    late = Finding(
        "IMU time", camera.status, value, camera.threshold, mend, "imu_time", camera.data
    )
    return [late if f is camera else f for f in findings if f is not truth]
