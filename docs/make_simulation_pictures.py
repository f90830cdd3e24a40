"""Render the pictures of docs/simulation.md: four images of every preset on one sheet."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from p2gd_fgo.simulation.presets import PRESETS, load_scenario
from p2gd_fgo.simulation.production import Studio, plan
from p2gd_fgo.simulation.recorder import write_sheet

IMAGES = Path(__file__).parent / "images" / "simulation"
SECONDS = (6.0, 14.0, 22.0, 30.0)


def main() -> None:
    """Write one JPEG for each preset."""
    IMAGES.mkdir(parents=True, exist_ok=True)
    for path in sorted(PRESETS.glob("*.yaml")):
        scenario = load_scenario(path, {"duration_s": 32.0})
        studio = Studio(plan(scenario))
        frames = [round(s * scenario.camera.rate_hz) for s in SECONDS]
        views = [(k, studio.view(k)) for k in frames]
        write_sheet([studio.expose(v, k) for k, v in views], IMAGES / f"{path.stem}.jpg", 1100)
        if path.stem == "crowded":
            masked = [np.where(v.mask() > 0, studio.expose(v, k), 255) for k, v in views[:2]]
            write_sheet([np.asarray(m, np.uint8) for m in masked], IMAGES / "masks.jpg", 1100)


if __name__ == "__main__":
    main()
