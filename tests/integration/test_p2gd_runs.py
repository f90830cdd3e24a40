"""P2GD through whole runs of the demo."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from demo_variants import ate_m, kinds, opened, settings

from p2gd_fgo.config import override
from p2gd_fgo.datasets.asl import AslSequence
from p2gd_fgo.errors import ConfigError, DataError
from p2gd_fgo.experiment import run_experiment
from p2gd_fgo.odometry import Odometry
from p2gd_fgo.pipeline import prior_source, run_sequence
from p2gd_fgo.priors import PriorSource
from p2gd_fgo.recorder import RunResult
from p2gd_fgo.trajectory_files import write_tum
from p2gd_fgo.types import Estimate, ImuBatch, PriorPoses, Trajectory

P2GD = {"distribution__kind": "p2gd"}


@pytest.fixture(scope="module")
def demo(short_demo: Path) -> AslSequence:
    return opened(short_demo)


@pytest.fixture(scope="module")
def truth(demo: AslSequence) -> Trajectory:
    assert demo.truth is not None
    return demo.truth.trajectory


@pytest.fixture(scope="module")
def guided(demo: AslSequence) -> RunResult:
    return run_sequence(demo, settings(**P2GD))


@pytest.fixture(scope="module")
def plain(demo: AslSequence) -> RunResult:
    return run_sequence(demo, settings())


def same(a: RunResult, b: RunResult) -> bool:
    return bool(
        np.array_equal(a.tracks.ids, b.tracks.ids)
        and np.array_equal(a.tracks.normalized, b.tracks.normalized)
        and np.array_equal(a.estimate.T_world_imu, b.estimate.T_world_imu)
    )


def test_it_follows_the_truth_repeats_and_differs_from_the_grid(
    demo: AslSequence, truth: Trajectory, guided: RunResult, plain: RunResult
) -> None:
    assert guided.status == "done"
    assert guided.priors == "truth"
    assert not [kind for kind in kinds(guided) if kind.startswith("priors")]
    assert ate_m(guided, truth) < 0.05
    assert same(guided, run_sequence(demo, settings(**P2GD)))
    assert not same(guided, plain)
    assert guided.tracks.asked.max() <= 150


@pytest.mark.parametrize(
    "fields",
    [
        {"distribution__p2gd__when": "before_tracking"},
        {"distribution__p2gd__allocate": "d_optimal", "distribution__p2gd__floor": 0.5},
        {"distribution__p2gd__weight": "track_length", "distribution__refill": True},
        {"priors__source": "constant_velocity"},
        {"priors__source": "noisy_truth", "priors__position_noise": 0.05},
    ],
    ids=str,
)
def test_each_option_runs_and_changes_something(
    demo: AslSequence, truth: Trajectory, guided: RunResult, fields: dict[str, object]
) -> None:
    result = run_sequence(demo, settings(**P2GD, **fields))
    assert result.status == "done"
    assert not same(result, guided)
    assert ate_m(result, truth) < 0.05


class Never:
    """A source whose every pose is NaN."""

    def __init__(self, inner: PriorSource) -> None:
        self.independent = inner.independent
        self.image_times = inner.image_times
        self.description = "not a number"
        self._inner = inner

    def poses(self, stamp_ns: int, recent: Trajectory) -> PriorPoses | None:
        ahead = self._inner.poses(stamp_ns, recent)
        return None if ahead is None else replace(ahead, T_imu0_imu=ahead.T_imu0_imu * np.nan)


def test_useless_priors_give_the_grids_run_and_one_event(
    demo: AslSequence, plain: RunResult
) -> None:
    config = settings(**P2GD)
    result = run_sequence(demo, config, priors=Never(prior_source(demo, config)))
    assert same(result, plain)
    events = [event for event in result.events if event.kind.startswith("priors")]
    assert [event.kind for event in events] == ["priors_not_finite"]
    # The image that starts the estimate has no pose yet, the last one nothing ahead.
    assert events[0].data["images"] == len(result.estimate) - 2
    none = run_sequence(demo, settings(**P2GD, priors__source="none"))
    assert same(none, plain)
    assert kinds(none).count("priors_missing") == 1


def test_a_planner_online_is_as_good_as_the_same_poses_from_the_recording(
    demo: AslSequence, guided: RunResult
) -> None:
    """Until the recording's end comes in sight, of which a planner online knows nothing."""
    config = settings(**P2GD)
    known = prior_source(demo, config)
    odometry = Odometry(
        demo.calibration, settings(**P2GD, priors__source="stream"), truth=demo.truth
    )
    given = 0
    estimates = []
    for index, stamp in enumerate(demo.image_stamps_ns.tolist()):
        upto = int(np.searchsorted(demo.imu.stamps_ns, stamp)) + 1
        imu = demo.imu
        odometry.add_imu(
            ImuBatch(imu.stamps_ns[given:upto], imu.gyro[given:upto], imu.accel[given:upto])
        )
        given = upto
        nothing = Trajectory(np.zeros(0, np.int64), np.zeros((0, 4, 4)))
        outcome = odometry.add_image(stamp, demo.image(index), known.poses(stamp, nothing))
        if isinstance(outcome, Estimate):
            estimates.append(outcome.state.T_world_imu)
    assert len(estimates) == len(guided.estimate)
    known_ahead = len(estimates) - config.backend.window  # images of which as many follow
    assert known_ahead > 40
    np.testing.assert_allclose(
        estimates[:known_ahead], guided.estimate.T_world_imu[:known_ahead], rtol=0, atol=1e-9
    )
    assert np.abs(estimates - guided.estimate.T_world_imu).max() < 0.01


def test_truth_as_a_planner_needs_a_truth(demo: AslSequence) -> None:
    with pytest.raises(ConfigError, match=r"priors\.source"):
        Odometry(demo.calibration, settings(**P2GD, priors__source="truth"))


def test_a_planner_that_is_named_but_not_chosen_is_refused() -> None:
    for field, value, source in (("file", "plan.tum", "file"), ("yaw_noise_deg", 1.0, "noisy")):
        with pytest.raises(ConfigError, match=source):
            settings(**P2GD, **{f"priors__{field}": value})


def test_a_plan_of_another_day_is_refused(
    demo: AslSequence, truth: Trajectory, tmp_path: Path
) -> None:
    plan = tmp_path / "plan.tum"
    write_tum(plan, Trajectory(truth.stamps_ns + 10**14, truth.T_world_imu))
    config = settings(**P2GD, priors__source="file", priors__file=str(plan))
    with pytest.raises(DataError, match="don't overlap"):
        run_sequence(demo, config)


def test_bad_input_leaves_an_earlier_run_alone(short_demo: Path, tmp_path: Path) -> None:
    good = settings(dataset__path=str(short_demo), dataset__duration_s=2.0)
    run_experiment(good, out=tmp_path / "run")
    before = {path.name: path.read_bytes() for path in (tmp_path / "run").iterdir()}
    bad = override(good, {"dataset.mask": str(tmp_path / "nowhere.png")})
    with pytest.raises(DataError):
        run_experiment(bad, out=tmp_path / "run", overwrite=True)
    assert {path.name: path.read_bytes() for path in (tmp_path / "run").iterdir()} == before
    with pytest.raises(DataError):
        run_experiment(bad, out=tmp_path / "new")
    assert not (tmp_path / "new").exists()
