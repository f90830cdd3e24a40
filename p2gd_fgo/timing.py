"""Process CPU and wall time per stage of a frame."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager

WHOLE_FRAME = "frame"
"""The stage that holds all the others of an image, but for decoding it."""


class StageTimer:
    """Adds up the time spent in named stages; one instance lives as long as a run.

    Stages may nest: one inside another is called ``outer.inner``, and its time is also in the
    outer one. Stages directly inside the whole frame keep their own name.
    """

    def __init__(self) -> None:
        self._cpu_ns: dict[str, int] = {}
        self._wall_ns: dict[str, int] = {}
        self._open: list[str] = []

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Time a block under ``name``."""
        if self._open and self._open[-1] != WHOLE_FRAME:
            name = f"{self._open[-1]}.{name}"
        self._open.append(name)
        self._cpu_ns.setdefault(name, 0)
        self._wall_ns.setdefault(name, 0)
        cpu, wall = time.process_time_ns(), time.perf_counter_ns()
        try:
            yield
        finally:
            self._cpu_ns[name] += time.process_time_ns() - cpu
            self._wall_ns[name] += time.perf_counter_ns() - wall
            self._open.pop()

    def take(self) -> dict[str, tuple[float, float]]:
        """(CPU ms, wall ms) by stage since the last call, in order of beginning; start anew."""
        out = {name: (cpu * 1e-6, self._wall_ns[name] * 1e-6) for name, cpu in self._cpu_ns.items()}
        self._cpu_ns.clear()
        self._wall_ns.clear()
        return out
