"""Every command, every configuration, and the exit codes."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from asl_folder import START_NS, AslFolder, imu_rows, truth_rows

from p2gd_fgo.cli.main import main
from p2gd_fgo.config import load_config

_ALL = sorted((Path(__file__).parents[2] / "configs").rglob("*.yaml"))
CONFIGS = [path for path in _ALL if path.parent.name != "simulation"]
BASES = [path for path in CONFIGS if path.parent.name == "configs"]  # the others only add a name

Cli = Callable[..., tuple[int, str, str]]


@pytest.fixture
def cli(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> Cli:
    """Runs the command line in a folder of its own: exit code, stdout, stderr."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "120")
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
        monkeypatch.setenv(name, os.environ.get(name, "1"))

    def call(*arguments: object) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["p2gd-fgo", *map(str, arguments)])
        with pytest.raises(SystemExit) as stop:
            main()
        printed = capsys.readouterr()
        code = stop.value.code
        return (code if isinstance(code, int) else 0), printed.out, printed.err

    return call


def refuse(cli: Cli, *arguments: object, says: tuple[str, ...]) -> None:
    code, out, err = cli("run", *arguments)
    assert code == 2, out + err
    assert "Traceback" not in err
    assert len(err.strip().splitlines()) == 1, err
    for part in says:
        assert part in err


class TestHelp:
    def test_lists_the_commands(self, cli: Cli) -> None:
        code, out, _ = cli("--help")
        assert code == 0
        assert all(command in out for command in ("run", "demo", "compare", "evaluate", "config"))

    def test_version(self, cli: Cli) -> None:
        code, out, _ = cli("--version")
        assert code == 0
        assert out.startswith("p2gd-fgo ")


class TestConfigDump:
    def test_dump_can_be_loaded_again(self, cli: Cli, tmp_path: Path) -> None:
        code, out, _ = cli("config", "dump", "--set", "frontend.max_features=99", "--seed", "3")
        assert code == 0
        assert "features kept per image" in out
        (tmp_path / "dump.yaml").write_text(out)
        config = load_config(tmp_path / "dump.yaml")
        assert config.frontend.max_features == 99
        assert config.runtime.seed == 3

    def test_width_fills_what_depends_on_it(self, cli: Cli) -> None:
        _, wide, _ = cli("config", "dump", "--width", "1280", "--no-comments")
        _, narrow, _ = cli("config", "dump", "--width", "752", "--no-comments")
        assert "max_features: 180" in wide
        assert "grid: [10, 6]" in wide
        assert "max_features: 150" in narrow
        assert "min_distance_px: 30.0" in narrow

    def test_shortcut_with_an_unknown_value(self, cli: Cli) -> None:
        code, _, err = cli("config", "dump", "--backend", "kalman")
        assert code == 2
        assert "backend.kind is 'kalman'" in err
        assert "'smoother'" in err

    @pytest.mark.parametrize("config", CONFIGS, ids=lambda p: p.stem)
    def test_every_configuration_is_valid(self, cli: Cli, config: Path) -> None:
        assert cli("config", "dump", config)[0] == 0


@pytest.fixture(scope="module")
def done(short_demo: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The directory of a finished run."""
    out = tmp_path_factory.mktemp("runs") / "first"
    process("run", short_demo, "--out", out)
    return out


def process(*arguments: object) -> None:
    command = [sys.executable, "-m", "p2gd_fgo", *map(str, arguments)]
    subprocess.run(command, check=True, capture_output=True)


class TestRun:
    def test_run_directory_is_whole(self, done: Path) -> None:
        names = {path.name for path in done.iterdir()}
        assert names == {
            "config.yaml", "estimate.tum", "events.jsonl", "evo_result.zip", "frames.csv",
            "metrics.json", "smoothed.tum", "status.json", "timing.csv", "tracks.npz",
            "trajectory.png", "truth.tum",
        }  # fmt: skip
        assert json.loads((done / "status.json").read_text())["state"] == "done"
        metrics = json.loads((done / "metrics.json").read_text())
        assert metrics["ate_m"]["yaw_pos"]["rmse"] < 0.1
        assert metrics["completeness"] > 0.7
        tracking = metrics["tracking"]
        assert tracking["rotations"] == "truth" and tracking["frames_without_rotation"] == 0
        assert 2.0 < tracking["mean_length"] < 20.0
        assert 0.0 < tracking["two_view_parallax_deg"] < tracking["total_parallax_deg"]
        assert 0.0 < tracking["single_frame_share"] < 1.0
        assert tracking["features_per_frame"] < tracking["quota_asked_per_frame"] <= 150
        assert load_config(done / "config.yaml").frontend.max_features == 150

    def test_two_processes_give_identical_bytes(self, done: Path, short_demo: Path) -> None:
        again = done.parent / "again"
        process("run", short_demo, "--out", again)
        for name in ("estimate.tum", "tracks.npz"):
            assert (again / name).read_bytes() == (done / name).read_bytes()

    def test_pictures_of_single_images(self, short_demo: Path, cli: Cli, tmp_path: Path) -> None:
        out = tmp_path / "out"
        code, printed, err = cli(
            "run", short_demo, "--distribution", "p2gd", "--figures", "5, 60,60", "--out", out
        )
        assert code == 0, err
        assert {p.name for p in (out / "figures").iterdir()} == {
            "features_000005.png", "p2gd_000060.png",
        }  # fmt: skip
        assert "picture of image 5 shows features and quotas alone" in " ".join(printed.split())
        events = (out / "events.jsonl").read_text()
        assert events.count("figure_without_p2gd") == 1

    def test_seed_varies_the_run(self, done: Path, short_demo: Path, cli: Cli) -> None:
        code, out, err = cli("run", short_demo, "--seed", 1, "--out", done.parent / "other")
        assert code == 0, err
        assert "yaw_pos" in out
        other = (done.parent / "other" / "estimate.tum").read_bytes()
        assert other != (done / "estimate.tum").read_bytes()

    def test_existing_run_is_kept_unless_told_otherwise(
        self, done: Path, short_demo: Path, cli: Cli
    ) -> None:
        refuse(cli, short_demo, "--out", done, says=("--overwrite",))

    def test_default_run_directory_is_named_by_the_configuration(
        self, short_demo: Path, cli: Cli, tmp_path: Path
    ) -> None:
        code, out, err = cli("run", short_demo, "--backend", "dead_reckoning")
        assert code == 0, err
        assert "dead_reckoning" in out
        (folder,) = (tmp_path / "results").glob("*/*")
        assert len(folder.name) == 10
        assert (folder / "estimate.tum").exists()

    def test_configuration_as_target(self, short_demo: Path, cli: Cli, tmp_path: Path) -> None:
        config = tmp_path / "mine.yaml"
        config.write_text(
            f"name: mine\ndataset: {{path: '{short_demo}', duration_s: 2.5}}\n"
            "initialization: {kind: given}\n"
        )
        code, out, err = cli("run", config, "--out", tmp_path / "out")
        assert code == 0, err
        assert "given, from truth" in out

    @pytest.mark.parametrize("config", BASES, ids=lambda p: p.stem)
    def test_every_configuration_runs(
        self, config: Path, short_demo: Path, cli: Cli, tmp_path: Path
    ) -> None:
        code, out, err = cli(
            "run", short_demo, "--config", config, "--set", "dataset.duration_s=3",
            "--out", tmp_path / "out",
        )  # fmt: skip
        assert code == 0, out + err

    def test_refused_start_is_a_failed_run(
        self, short_demo: Path, cli: Cli, tmp_path: Path
    ) -> None:
        out = tmp_path / "out"
        code, printed, _ = cli(
            "run", short_demo, "--out", out, "--set", "dataset.start_s=4",
            "--set", "dataset.duration_s=2",
        )  # fmt: skip
        assert code == 1
        assert "THE RUN FAILED" in printed
        assert "threshold" in printed
        status = json.loads((out / "status.json").read_text())
        assert status["state"] == "failed"
        assert "threshold" in status["reason"]

    def test_no_truth_is_said_aloud(self, cli: Cli, tmp_path: Path, short_demo: Path) -> None:
        copy = tmp_path / "copy" / "mav0"
        copy.mkdir(parents=True)
        for sensor in ("cam0", "imu0"):
            (copy / sensor).symlink_to(short_demo / "mav0" / sensor)
        code, printed, _ = cli("run", copy.parent, "--out", tmp_path / "out")
        assert code == 0
        assert "NO TRUTH" in printed
        assert json.loads((tmp_path / "out" / "metrics.json").read_text())["ate_m"] is None

    def test_evaluate_agrees_with_the_run(self, done: Path, cli: Cli, tmp_path: Path) -> None:
        code, out, err = cli(
            "evaluate", done / "estimate.tum", done / "truth.tum", "--json", tmp_path / "m.json"
        )
        assert code == 0, err
        assert "yaw_pos" in out
        again = json.loads((tmp_path / "m.json").read_text())
        metrics = json.loads((done / "metrics.json").read_text())
        rmse = metrics["ate_m"]["yaw_pos"]["rmse"]
        assert again["ate_m"]["yaw_pos"]["rmse"] == pytest.approx(rmse, rel=1e-6)


class TestCompare:
    SHORT = ("--set", "dataset.duration_s=3", "--set", "initialization.kind=given")

    def rows(self, printed: str) -> list[list[str]]:
        """Cells of the table's rows."""
        lines = [line.split() for line in printed.splitlines()]
        return [cells for cells in lines if cells and cells[0] in ("smoother", "dead_reckoning")]

    def test_one_row_and_one_run_directory_for_each_combination(
        self, short_demo: Path, cli: Cli, tmp_path: Path
    ) -> None:
        out = tmp_path / "many"
        arguments = (
            "compare", short_demo, "--backend", "smoother,dead_reckoning",
            "--distribution", "grid, p2gd", "--out", out, "--seed", 3, *self.SHORT,
        )  # fmt: skip
        code, printed, err = cli(*arguments)
        assert code == 0, err
        names = [f"{b}-{d}" for b in ("smoother", "dead_reckoning") for d in ("grid", "p2gd")]
        assert ["-".join(cells[:2]) for cells in self.rows(printed)] == names
        assert all(cells[-1] == "done" for cells in self.rows(printed))
        assert "yaw_pos (position + yaw)" in printed and "4, one per row" in printed
        for name in names:
            metrics = json.loads((out / name / "metrics.json").read_text())
            assert f"{metrics['backend']}-{metrics['distribution']}" == name
            assert metrics["seed"] == 3

        code, _, err = cli(*arguments)
        assert code == 2 and "--overwrite" in err
        alone = tmp_path / "alone"
        assert cli("run", short_demo, "--seed", 3, "--out", alone, *self.SHORT)[0] == 0
        again = (out / "smoother-grid" / "estimate.tum").read_bytes()
        assert again == (alone / "estimate.tum").read_bytes()

    def test_failed_runs_have_their_rows(
        self, short_demo: Path, cli: Cli, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setenv("COLUMNS", "80")  # no terminal: still one table, no row cut
        code, printed, _ = cli(
            "compare", short_demo, "--distribution", "grid,p2gd", "--out", tmp_path / "out",
            "--set", "dataset.start_s=4", "--set", "dataset.duration_s=2",
        )  # fmt: skip
        assert code == 1
        assert [cells[-1] for cells in self.rows(printed)] == ["FAILED"] * 2
        assert "smoother-grid failed: " in printed and "…" not in printed

    @pytest.mark.parametrize(
        ("option", "names", "says"),
        [
            ("--backend", "smoother,smother", "did you mean 'smoother'"),
            ("--distribution", "grid,", "it takes grid, p2gd"),
            ("--distribution", "grid,p2gd,grid", "'grid' stands there twice"),
        ],
    )
    def test_unknown_names(
        self, short_demo: Path, cli: Cli, tmp_path: Path, option: str, names: str, says: str
    ) -> None:
        out = tmp_path / "out"
        code, _, err = cli("compare", short_demo, option, names, "--out", out)
        assert code == 2 and says in err and option in err
        assert len(err.strip().splitlines()) == 1 and not out.exists()

    def test_bad_input_of_all_runs_is_one_sentence(self, cli: Cli, tmp_path: Path) -> None:
        code, _, err = cli("compare", tmp_path / "nowhere", "--out", tmp_path / "out")
        assert code == 2 and "nowhere" in err
        assert len(err.strip().splitlines()) == 1


class TestBadInput:
    def test_missing_folder(self, cli: Cli, tmp_path: Path) -> None:
        refuse(cli, tmp_path / "nowhere", says=("nowhere",))

    def test_misspelt_key(self, cli: Cli, tmp_path: Path) -> None:
        refuse(
            cli, tmp_path, "--set", "frontend.max_featurs=3",
            says=("frontend.max_featurs", "did you mean 'max_features'"),
        )  # fmt: skip

    def test_window_of_one(self, cli: Cli, tmp_path: Path) -> None:
        refuse(cli, tmp_path, "--set", "backend.window=1", says=("backend.window is 1",))

    @pytest.mark.parametrize("frames", ["12x", "-3", "1,,2", ""])
    def test_figures_that_are_no_numbers(self, cli: Cli, tmp_path: Path, frames: str) -> None:
        refuse(cli, tmp_path, f"--figures={frames}", says=("--figures", "120,450"))

    def test_figures_beyond_the_recording(self, cli: Cli, short_demo: Path, tmp_path: Path) -> None:
        out = tmp_path / "out"
        refuse(cli, short_demo, "--figures", "5,71", "--out", out, says=("71", "from 0 to 70"))
        assert not out.exists()

    def test_setting_without_value(self, cli: Cli, tmp_path: Path) -> None:
        refuse(cli, tmp_path, "--set", "backend.window", says=("KEY=VALUE",))

    def test_two_configurations(self, cli: Cli) -> None:
        refuse(cli, CONFIGS[0], "--config", CONFIGS[1], says=("two configurations",))

    @pytest.mark.parametrize("text", ["", "#timestamp [ns],filename\n"], ids=["empty", "no rows"])
    def test_camera_csv_without_rows(self, cli: Cli, tmp_path: Path, text: str) -> None:
        folder = AslFolder(tmp_path / "seq").write()
        folder.camera_csv.write_text(text)
        refuse(cli, folder.root, says=("data.csv",))

    def test_no_listed_image_exists(self, cli: Cli, tmp_path: Path) -> None:
        folder = AslFolder(tmp_path / "seq").write()
        for index in range(len(folder.image_stamps)):
            folder.image(index).unlink()
        refuse(cli, folder.root, says=("cam0",))

    def test_imu_and_images_apart(self, cli: Cli, tmp_path: Path) -> None:
        rows = imu_rows(first_ns=START_NS + 10**12)
        folder = AslFolder(tmp_path / "seq", imu=rows, truth=None).write()
        refuse(cli, folder.root, says=("don't overlap", "data.csv"))

    def test_nan_in_the_imu(self, cli: Cli, tmp_path: Path) -> None:
        rows = imu_rows()
        rows[7][2] = "nan"
        folder = AslFolder(tmp_path / "seq", imu=rows).write()
        refuse(cli, folder.root, says=("imu0", "line 9"))

    def test_image_stamps_not_increasing(self, cli: Cli, tmp_path: Path) -> None:
        folder = AslFolder(tmp_path / "seq").write()
        lines = folder.camera_csv.read_text().splitlines()
        lines[3], lines[4] = lines[4], lines[3]
        folder.camera_csv.write_text("\n".join(lines) + "\n")
        refuse(cli, folder.root, says=("data.csv", "line 5"))

    def test_unknown_distortion_model(self, cli: Cli, tmp_path: Path) -> None:
        folder = AslFolder(tmp_path / "seq")
        assert folder.camera is not None
        folder.camera["distortion_model"] = "fov"
        refuse(cli, folder.write().root, says=("distortion_model", "'fov'"))

    def test_given_start_without_overlapping_truth(self, cli: Cli, tmp_path: Path) -> None:
        rows = truth_rows(first_ns=START_NS + 10**12)
        folder = AslFolder(tmp_path / "seq", truth=rows).write()
        refuse(cli, folder.root, "--set", "initialization.kind=given", says=("truth",))

    def test_given_start_without_truth(self, cli: Cli, tmp_path: Path) -> None:
        folder = AslFolder(tmp_path / "seq", truth=None).write()
        refuse(cli, folder.root, "--set", "initialization.kind=given", says=("no truth",))

    def test_no_imu_noise_anywhere(self, cli: Cli, tmp_path: Path) -> None:
        folder = AslFolder(tmp_path / "seq", imu_sensor=None).write()
        refuse(cli, folder.root, says=("imu.gyro_noise_density",))

    def test_out_in_a_folder_of_other_things(
        self, cli: Cli, tmp_path: Path, short_demo: Path
    ) -> None:
        (tmp_path / "precious.txt").write_text("keep")
        refuse(cli, short_demo, "--out", tmp_path, "--overwrite", says=("no run",))
        assert (tmp_path / "precious.txt").read_text() == "keep"

    def test_evaluate_of_a_broken_file(self, cli: Cli, tmp_path: Path) -> None:
        broken = tmp_path / "broken.tum"
        broken.write_text("1.0 2 3\n")
        code, _, err = cli("evaluate", broken, broken)
        assert code == 2
        assert "broken.tum" in err

    def test_evaluate_into_no_folder(self, cli: Cli, tmp_path: Path, done: Path) -> None:
        trajectory, target = done / "estimate.tum", tmp_path / "no" / "x.json"
        code, _, err = cli("evaluate", trajectory, trajectory, "--json", target)
        assert code == 2 and "x.json: can't be written" in err
