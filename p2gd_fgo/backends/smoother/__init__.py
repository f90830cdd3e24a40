"""GTSAM fixed-lag smoother: preintegrated IMU factors and smart projection factors.

One frame of the smoother reads in :class:`p2gd_fgo.backends.smoother.smoother.Smoother`.
"""

from p2gd_fgo.backends.smoother.smoother import Smoother

__all__ = ["Smoother"]
