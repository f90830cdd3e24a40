"""The doctor on healthy recordings and on copies of them broken one way at a time.

``run.py FOLDER [FOLDER ...]``: a table in markdown.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

from p2gd_fgo.threads import set_thread_environment

set_thread_environment(1)

import cv2  # noqa: E402
from breaking import BREAKS, Break, read, write  # noqa: E402

from p2gd_fgo.cli.refusing import run_refusing  # noqa: E402
from p2gd_fgo.config import load_config, override, resolve  # noqa: E402
from p2gd_fgo.datasets import open_sequence  # noqa: E402
from p2gd_fgo.doctor import Report, examine  # noqa: E402
from p2gd_fgo.errors import DataError  # noqa: E402


def diagnose(folder: Path) -> Report | DataError:
    config = override(load_config(), {"dataset.path": str(folder)})
    try:
        sequence = open_sequence(config.dataset, max_gap_s=config.imu.max_gap_s)
    except DataError as error:
        return error
    return examine(sequence, resolve(config, sequence.calibration.camera.width)).report


def judge(found: Report | DataError, broken: Break) -> tuple[bool, str]:
    """Right: a name that fits, no name that doesn't, and not fit without a warning."""
    if isinstance(found, DataError):
        return "refused" in broken.names, f"refused: {found}"
    said = "; ".join(f"**{f.fault}**: {f.value}" for f in found.findings if f.fault in found.faults)
    wrong = set(found.faults) - {*broken.names, *broken.along}
    right = bool(set(found.faults) & set(broken.names)) and not wrong
    return right, f"{found.verdict}: {said or 'nothing'}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folders", type=Path, nargs="+", help="ASL folders with truth")
    parser.add_argument("--healthy", action="store_true", help="break nothing")
    parser.add_argument("--only", help="breaks whose name holds this")
    options = parser.parse_args()
    cv2.setNumThreads(1)
    write_out = sys.stdout.write
    for folder in options.folders:
        healthy = diagnose(folder)
        if isinstance(healthy, DataError):
            raise healthy
        write_out(f"\n### {folder.name}\n\n{healthy.verdict}, {healthy.seconds:.0f} s")
        for finding in healthy.findings:
            if finding.status in ("warning", "fault", "undetermined"):
                write_out(f"; {finding.check}: {finding.value}")
        write_out("\n")
        if options.healthy:
            continue
        write_out("\n| broken | right | the doctor says |\n|---|---|---|\n")
        count = 0
        chosen = {n: b for n, b in BREAKS.items() if options.only is None or options.only in n}
        for name, broken in chosen.items():
            with tempfile.TemporaryDirectory() as scratch:
                copy = read(folder / "mav0")
                broken.spoil(copy)
                target = write(copy, folder / "mav0", Path(scratch) / folder.name)
                right, said = judge(diagnose(target), broken)
            count += right
            said = said.replace(scratch, "").replace("|accelerometer|", "accelerometer")
            write_out(f"| {name} | {'yes' if right else '**no**'} | {said} |\n")
            sys.stdout.flush()
        write_out(f"\n{count} of {len(chosen)} named right.\n")


if __name__ == "__main__":
    run_refusing(main)
