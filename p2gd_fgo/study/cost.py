"""What a study will cost, said before it starts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from p2gd_fgo.study.data import images_key, is_rendered
from p2gd_fgo.study.runs import Rendered, Run

# Seconds of CPU, measured on one core of 2026: an image of 1280x560 is rendered in 0.22, one of
# 800x600 in 0.13; an image of a run takes 0.02 with all that belongs to it, and a run 1 more.
_RENDER_S_PER_PIXEL = 3.0e-7
_RUN_S_PER_IMAGE = 0.02
_RUN_S = 1.0
_BYTES_PER_PIXEL = 0.75  # of an image with the sensor's noise, and its mask


@dataclass(frozen=True, slots=True)
class Cost:
    """Of what is still to be done.

    Attributes
    ----------
    runs
        To be done.
    images
        To be rendered.
    rendering_s, running_s
        CPU.
    disk_bytes
        That the rendered images take.
    """

    runs: int
    images: int
    rendering_s: float
    running_s: float
    disk_bytes: float

    @property
    def total_s(self) -> float:
        """CPU in all."""
        return self.rendering_s + self.running_s


def estimate_cost(runs: Sequence[Run]) -> Cost:
    """Cost of runs, and of rendering what they need and what isn't there yet."""
    sources = {images_key(r.source): r.source for r in runs if isinstance(r.source, Rendered)}
    missing = [source for source in sources.values() if not is_rendered(source)]
    pixels = sum(s.images * s.scenario.camera.width * s.scenario.camera.height for s in missing)
    return Cost(
        runs=len(runs),
        images=sum(source.images for source in missing),
        rendering_s=pixels * _RENDER_S_PER_PIXEL,
        running_s=sum(run_seconds(run) for run in runs),
        disk_bytes=pixels * _BYTES_PER_PIXEL,
    )


def run_seconds(run: Run) -> float:
    """CPU of one run."""
    return _RUN_S + run.source.images * _RUN_S_PER_IMAGE
