"""Windows of simulated drives for the tests of the start in motion."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from p2gd_fgo.frontend import FeatureBuffer
from p2gd_fgo.geometry import so3
from p2gd_fgo.initialization.bundle import WindowStates
from p2gd_fgo.initialization.sightings import SightingStore, WindowSightings
from p2gd_fgo.initialization.static import heading_frame
from p2gd_fgo.simulation.feature_recording import (
    CAR_PLATFORM,
    FeatureRecording,
    Platform,
    record_features,
)
from p2gd_fgo.types import FloatArray, NavState, Observations


def drive(
    seed: int,
    *,
    duration_s: float = 12.0,
    noise: bool = True,
    platform: Platform = CAR_PLATFORM,
    outlier_share: float = 0.0,
) -> FeatureRecording:
    """A short drive, seen with fewer features than usual."""
    features = replace(platform.features, features=80)
    return record_features(
        replace(platform, features=features),
        duration_s,
        np.random.default_rng(seed),
        noise=noise,
        outlier_share=outlier_share,
    )


def buffer_of(observations: Observations) -> FeatureBuffer:
    """A buffer whose newest image saw these features."""
    buffer = FeatureBuffer(2)
    buffer.advance(observations.stamp_ns, np.zeros((0, 2)), np.zeros((0, 2)))
    buffer.add(observations.pixels, observations.normalized)
    buffer.ids = observations.ids
    return buffer


def window(recording: FeatureRecording, first: int, last: int, images: int = 25) -> WindowSightings:
    """The sightings of the images from first to last."""
    store = SightingStore(100.0)
    for k in range(first, last + 1):
        store.add(int(recording.image_stamps_ns[k]), buffer_of(recording.observations[k]))
    return store.window(images)


def true_states(recording: FeatureRecording, sightings: WindowSightings) -> WindowStates:
    """The truth in the frame that is pinned at the newest image."""
    at = np.searchsorted(recording.image_stamps_ns, sightings.stamps_ns)
    T = recording.T_world_imu[at]
    turn = heading_frame(T[-1, 2, :3]) @ T[-1, :3, :3].T
    return WindowStates(
        turn @ T[:, :3, :3],
        (T[:, :3, 3] - T[-1, :3, 3]) @ turn.T,
        recording.velocity[at] @ turn.T,
        recording.gyro_bias[at],
        recording.accel_bias[at],
    )


def error_of(state: NavState, truth: WindowStates) -> FloatArray:
    """(15,) of a newest state, as :class:`p2gd_fgo.types.Estimate` defines it."""
    T = state.T_world_imu
    return np.concatenate(
        [
            so3.log(T[:3, :3].T @ truth.R[-1]),
            truth.p[-1] - T[:3, 3],
            truth.v[-1] - state.velocity,
            truth.gyro_bias[-1] - state.gyro_bias,
            truth.accel_bias[-1] - state.accel_bias,
        ]
    )
