"""Trajectories of other programs in a study: where they are looked for, and what they become."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from asl_folder import AslFolder
from pydantic import ValidationError

from p2gd_fgo.datasets import open_sequence
from p2gd_fgo.errors import ConfigError
from p2gd_fgo.run_record import RunRecord
from p2gd_fgo.study.data import provide
from p2gd_fgo.study.expansion import Plan, expand
from p2gd_fgo.study.external import External, judge
from p2gd_fgo.study.spec import StudySpec
from p2gd_fgo.study.store import is_finished
from p2gd_fgo.trajectory_files import write_tum
from p2gd_fgo.types import Trajectory

SMALL: dict[str, Any] = {
    "name": "s",
    "question": "q",
    "sequences": [{"simulate": "robot_like", "routes": [3, 4], "duration_s": 2}],
    "axes": {"backend": ["smoother", "msckf"], "distribution": ["grid", "p2gd"], "seed": [0, 1]},
    "pairing": {"axis": "distribution", "baseline": "grid"},
    "external": {"Peer": "peers/{sequence}.tum"},
}


def plan(folder: Path, data: Path | None = None, **changes: Any) -> Plan:
    return expand(StudySpec.model_validate(SMALL | changes), folder, data)


def put(root: Path, name: str = "robot_like-3", text: str = "0 0 0 0 0 0 0 1\n") -> Path:
    (root / "peers").mkdir(parents=True, exist_ok=True)
    (root / "peers" / f"{name}.tum").write_text(text)
    return root / "peers" / f"{name}.tum"


def test_files_are_found_under_data_or_else_beside_the_study(tmp_path: Path) -> None:
    study, data = tmp_path / "study", tmp_path / "data"
    near, under = put(study), put(data)
    data.mkdir(exist_ok=True)
    found = plan(study, data)
    (there,) = found.externals
    assert (there.file, there.name, there.group) == (under, "Peer", "robot_like")
    assert found.absent == (data / "peers" / "robot_like-4.tum",)
    assert found.rows == (*found.runs, there)
    under.unlink()
    assert [e.file for e in plan(study, data).externals] == [near]
    assert [e.file for e in plan(study).externals] == [near]
    absolute = {"Peer": f"{near.parent}/{{sequence}}.tum"}
    assert [e.file for e in plan(tmp_path, external=absolute).externals] == [near]


def test_without_any_file_it_is_refused_unless_it_may_lie_under_data(tmp_path: Path) -> None:
    assert plan(tmp_path).left_out == ("peers/{sequence}.tum",)
    with pytest.raises(ConfigError, match=r"external\.Peer: there is no file .*robot_like-3\.tum"):
        plan(tmp_path, tmp_path)
    with pytest.raises(ConfigError, match=r"it may hold \{sequence\}, \{group\}"):
        plan(tmp_path, external={"Peer": "{route}.tum"})


def test_a_name_must_have_a_place_on_the_pairing_axis() -> None:
    for changes, words in (
        ({"pairing": None}, "external needs 'pairing'"),
        ({"external": {"p2gd": "x"}}, "external 'p2gd' is a label of the axis 'distribution'"),
    ):
        with pytest.raises(ValidationError, match=words):
            StudySpec.model_validate(SMALL | changes)


def test_a_key_names_file_and_judgement(tmp_path: Path) -> None:
    put(tmp_path)

    def key(**changes: Any) -> str:
        return plan(tmp_path, **changes).externals[0].key

    first = key()
    assert key(question="another?", timeout_s=3) == first
    assert key(base={"settings": {"frontend.max_features": 99}}) == first
    assert key(base={"settings": {"evaluation.alignment": "origin"}}) != first
    put(tmp_path, text="0 0 0 0 0 0 0 1\n1 0 0 0 0 0 0 1\n")
    assert key() != first


@pytest.fixture
def external(tmp_path: Path) -> External:
    AslFolder(tmp_path / "walk").write()
    put(tmp_path, "walk")
    return plan(tmp_path, tmp_path, sequences=[{"path": "walk"}]).externals[0]


def test_it_is_judged_against_the_truth_of_its_recording(external: External) -> None:
    dataset = external.run.config.dataset.model_copy(
        update={"path": str(provide(external.run.source))}
    )
    truth = open_sequence(dataset).truth
    assert truth is not None
    T = truth.trajectory.T_world_imu.copy()
    T[:, 0, 3] += 0.2 * np.sin(np.linspace(0.0, 50.0, len(T)))
    write_tum(external.file, Trajectory(truth.trajectory.stamps_ns, T))
    record = judge(external)
    assert record.status == "done", record.reason
    assert record.metrics["ate_m"]["yaw_pos"]["rmse"] == pytest.approx(0.2 / 2**0.5, rel=0.1)
    assert (record.study, record.group, record.sequence) == ("s", "recordings", "walk")
    assert record.metrics["frames_total"] == external.run.source.images
    assert record.axes == {"distribution": "Peer"} and record.key == external.key
    assert is_finished(record, record.code) and not is_finished(record, "other code")
    assert RunRecord.from_json(record.to_json()) == record


def test_a_file_that_is_no_trajectory_is_said_in_the_record(external: External) -> None:
    external.file.write_text("no trajectory\n")
    record = judge(external)
    assert record.status == "crashed" and str(external.file) in (record.reason or "")
