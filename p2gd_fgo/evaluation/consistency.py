"""Whether an estimator's covariance says how large its errors are."""

from __future__ import annotations

import numpy as np

from p2gd_fgo.errors import DataError
from p2gd_fgo.geometry import so3
from p2gd_fgo.types import FloatArray


def pose_error(T_world_estimate: FloatArray, T_world_truth: FloatArray) -> FloatArray:
    """Errors (N, 6): δθ with R = R̂ Exp(δθ), then δp = p − p̂ in the world.

    Poses are (N, 4, 4), in the same world: an alignment would take a part of the error away.
    """
    Rt = np.swapaxes(T_world_estimate[:, :3, :3], -1, -2)
    return np.concatenate(
        [
            so3.log(Rt @ T_world_truth[:, :3, :3]),
            T_world_truth[:, :3, 3] - T_world_estimate[:, :3, 3],
        ],
        axis=1,
    )


def nees(errors: FloatArray, covariances: FloatArray) -> FloatArray:
    """Normalised estimation error squared (N,): eᵀ P⁻¹ e of (N, k) and (N, k, k).

    Of a consistent estimator its mean is k (Bar-Shalom, Li, Kirubarajan, "Estimation with
    Applications to Tracking and Navigation", 2001, section 5.4).

    Raises
    ------
    DataError
        A covariance is not positive definite.
    """
    try:
        L = np.linalg.cholesky(covariances)
    except np.linalg.LinAlgError:
        lowest = np.linalg.eigvalsh(covariances)[:, 0]
        row = int(np.argmin(lowest))
        raise DataError(
            f"covariance {row} is not positive definite: its lowest eigenvalue is {lowest[row]:.3g}"
        ) from None
    whitened = np.linalg.solve(L, errors[..., None])[..., 0]
    return np.asarray(np.sum(whitened * whitened, axis=-1))


def free_sigmas(T_world_imu: FloatArray, covariances: FloatArray) -> FloatArray:
    """Standard deviations (N, 4) of x, y, z (m) and yaw (rad), which no camera and IMU can tell.

    Parameters
    ----------
    T_world_imu
        (N, 4, 4) estimates.
    covariances
        (N, k, k), k ≥ 6, of (δθ in the IMU frame, δp in the world, ...).

    An estimator whose values fall below those of its start has learnt what can't be known. Yaw is
    the rotation about the world's z axis.
    """
    up = T_world_imu[:, 2, :3]
    yaw = np.einsum("ni,nij,nj->n", up, covariances[:, :3, :3], up)
    position = np.diagonal(covariances[:, 3:6, 3:6], axis1=1, axis2=2)
    return np.asarray(np.sqrt(np.column_stack([position, yaw])))
