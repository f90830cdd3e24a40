"""Process CPU and wall time per stage of a frame."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager


class StageTimer:
    """Adds up the time spent in named stages; one instance lives as long as a run.

    Stages may nest; the time of an inner stage is then also in the outer one.
    """

    def __init__(self) -> None:
        self._cpu_ns: dict[str, int] = {}
        self._wall_ns: dict[str, int] = {}

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Time a block under ``name``."""
        cpu, wall = time.process_time_ns(), time.perf_counter_ns()
        try:
            yield
        finally:
            self._cpu_ns[name] = self._cpu_ns.get(name, 0) + time.process_time_ns() - cpu
            self._wall_ns[name] = self._wall_ns.get(name, 0) + time.perf_counter_ns() - wall

    def take(self) -> dict[str, tuple[float, float]]:
        """(CPU ms, wall ms) by stage since the last call, and start anew."""
        out = {name: (cpu * 1e-6, self._wall_ns[name] * 1e-6) for name, cpu in self._cpu_ns.items()}
        self._cpu_ns.clear()
        self._wall_ns.clear()
        return out
