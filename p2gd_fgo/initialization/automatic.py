"""Start from a standstill where there is one, and otherwise in motion."""

from __future__ import annotations

from p2gd_fgo.errors import InitializationError
from p2gd_fgo.frontend import FeatureBuffer
from p2gd_fgo.initialization.base import Initializer, Start
from p2gd_fgo.types import ImuBatch, Waiting


class AutoStart:
    """Asks the static start first at every image, then the dynamic one.

    Both are given the same data; the first that can start does.
    """

    def __init__(self, static: Initializer, dynamic: Initializer) -> None:
        self._static, self._dynamic = static, dynamic

    def attempt(self, stamp_ns: int, imu: ImuBatch, buffer: FeatureBuffer) -> Start | Waiting:
        """Start here if either can; a refusal of one alone is none."""
        still = self._ask(self._static, stamp_ns, imu, buffer)
        if isinstance(still, Start):
            return still
        moving = self._ask(self._dynamic, stamp_ns, imu, buffer)
        if isinstance(moving, Start):
            return moving
        if still is None and moving is None:
            raise self.refusal()
        return Waiting(stamp_ns, "waiting for a standstill, or motion that shows scale")

    def refusal(self) -> InitializationError:
        """Both reasons."""
        return InitializationError(f"{self._static.refusal()}; {self._dynamic.refusal()}")

    @staticmethod
    def _ask(
        one: Initializer, stamp_ns: int, imu: ImuBatch, buffer: FeatureBuffer
    ) -> Start | Waiting | None:
        try:
            return one.attempt(stamp_ns, imu, buffer)
        except InitializationError:
            return None
