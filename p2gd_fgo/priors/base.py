"""What every source of prior poses looks like to the odometry."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from p2gd_fgo.priors.image_times import ImageTimes
from p2gd_fgo.types import PriorPoses, Trajectory


@dataclass(frozen=True, slots=True)
class PriorProblem:
    """Why the prior poses of an image are not used.

    Attributes
    ----------
    kind
        Short snake_case name, of an event: ``priors_missing``, ``priors_late``,
        ``priors_too_few``, ``priors_not_finite``, ``priors_not_rigid``, ``priors_unordered``,
        ``priors_contradicted``.
    message
        What is wrong, with the value and the threshold; no full stop.
    """

    kind: str
    message: str


class PriorSource(Protocol):
    """Where prior poses come from."""

    @property
    def description(self) -> str:
        """For the head of the table."""
        ...

    @property
    def independent(self) -> bool:
        """Whether the poses say more than the estimate: only then it can contradict them."""
        ...

    @property
    def image_times(self) -> ImageTimes:
        """When the next images come, as far as the source knows."""
        ...

    def poses(self, stamp_ns: int, recent: Trajectory) -> PriorPoses | None:
        """Poses after ``stamp_ns``, relative to the body at ``stamp_ns``.

        They may come at any rate; at the times of :attr:`image_times` they need no interpolation.

        Parameters
        ----------
        stamp_ns
            Of the current image, on the IMU's clock.
        recent
            The estimate's window, the current pose included, newest last.

        Returns
        -------
        PriorPoses | None
            None where the source has nothing for that time.
        """
        ...
