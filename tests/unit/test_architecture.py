"""The house: a room imports only rooms listed above it."""

from __future__ import annotations

import ast
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

import p2gd_fgo

ROOT = Path(p2gd_fgo.__file__).parent
ROOMS = [
    *(
        "errors",
        "user_paths",
        "threads",
        "types",
        "timing",
        "config",
        "geometry",
        "imu",
        "imu_intake",
        "datasets",
    ),
    *("atomic_files", "trajectory_files", "simulation", "priors", "frontend", "distribution"),
    *("initialization", "doctor", "backends", "troubles", "odometry", "recorder", "pipeline"),
    *("run_directory", "run_record", "evaluation"),
    *("report", "experiment", "study", "cli", "__main__"),
]
FILES = sorted(
    path.relative_to(ROOT) for path in ROOT.rglob("*.py") if path != ROOT / "__init__.py"
)


def room(path: Path) -> str:
    return path.parts[0].removesuffix(".py")


def imports(path: Path) -> Iterator[str]:
    """Dotted names of the modules that a file imports, wherever in it."""
    for node in ast.walk(ast.parse((ROOT / path).read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def test_every_room_has_its_place() -> None:
    assert {room(path) for path in FILES} <= set(ROOMS)


@pytest.mark.parametrize("path", FILES, ids=str)
def test_a_room_imports_only_rooms_above_it(path: Path) -> None:
    for name in imports(path):
        package, _, rest = name.partition(".")
        other = rest.partition(".")[0]
        if package == "p2gd_fgo" and other in ROOMS and other != room(path):
            assert ROOMS.index(other) < ROOMS.index(room(path)), f"{path} imports {name}"


@pytest.mark.parametrize(
    ("library", "allowed"),
    [
        ("evo", "evaluation/evo_bridge.py"),
        ("gtsam", "backends/smoother/"),
        ("typer", "cli/"),
        ("numba", "simulation/"),
        ("matplotlib", "report/"),
        ("jinja2", "report/pages/html.py"),
    ],
)
def test_a_library_stays_in_its_room(library: str, allowed: str) -> None:
    users = {str(p) for p in FILES if library in {name.partition(".")[0] for name in imports(p)}}
    assert all(user.startswith(allowed) for user in users), users


@pytest.mark.parametrize("path", [p for p in FILES if room(p) not in {"cli", "__main__"}], ids=str)
def test_only_the_command_line_prints_and_exits(path: Path) -> None:
    for node in ast.walk(ast.parse((ROOT / path).read_text(encoding="utf-8"))):
        if isinstance(node, ast.Call):
            assert ast.unparse(node.func) not in {"print", "exit", "quit", "sys.exit", "os._exit"}
        if isinstance(node, ast.Name):
            assert node.id != "SystemExit"


@pytest.mark.parametrize("module", ["p2gd_fgo.config", "p2gd_fgo.errors", "p2gd_fgo.cli.main"])
def test_configuration_is_read_before_the_threaded_libraries_load(module: str) -> None:
    code = f"import sys, {module}; print(*{{m.partition('.')[0] for m in sys.modules}})"
    made = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert not {"numpy", "cv2", "gtsam", "scipy", "numba"} & set(made.stdout.split())
