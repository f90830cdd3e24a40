"""The values between the rooms: frozen, of a size, and errors that say when and why."""

from __future__ import annotations

from dataclasses import FrozenInstanceError

import numpy as np
import pytest

from p2gd_fgo import errors, types


def test_values_are_frozen_and_have_no_place_for_more() -> None:
    kinds = [k for k in vars(types).values() if isinstance(k, type) and hasattr(k, "__slots__")]
    kinds = [k for k in kinds if k.__module__ == types.__name__]
    assert len(kinds) == 10
    for kind in kinds:
        assert kind.__doc__
        assert kind.__dataclass_params__.frozen  # type: ignore[attr-defined]
    waiting = types.Waiting(1, "for a standstill")
    with pytest.raises(FrozenInstanceError):
        waiting.reason = ""  # type: ignore[misc]


def test_batches_have_a_length() -> None:
    stamps = np.arange(3)
    assert len(types.ImuBatch(stamps, np.zeros((3, 3)), np.zeros((3, 3)))) == 3
    assert len(types.Trajectory(stamps, np.zeros((3, 4, 4)))) == 3
    assert len(types.Observations(0, stamps, np.zeros((3, 2)), np.zeros((3, 2)))) == 3


def test_states_do_not_share_their_default_biases() -> None:
    a, b = (types.NavState(0, np.eye(4), np.zeros(3)) for _ in range(2))
    assert a.gyro_bias is not b.gyro_bias and a.gyro_bias is not a.accel_bias


def test_every_error_is_of_the_family() -> None:
    for name in ("ConfigError", "DataError", "InitializationError", "EstimatorError"):
        assert issubclass(getattr(errors, name), errors.P2gdError)
    error = errors.EstimatorError(12, "the window is singular")
    assert (error.stamp_ns, error.reason) == (12, "the window is singular")
    assert str(error) == "at 12 ns: the window is singular"
