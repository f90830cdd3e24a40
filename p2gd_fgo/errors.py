"""Exceptions of the package.

Every message is one sentence that names the file or field, the value found and the mend; the
command line prints it as it is.
"""

from __future__ import annotations


class P2gdError(Exception):
    """Base of all errors that a user can cause or mend."""


class ConfigError(P2gdError):
    """A configuration file, key or value that can't be used."""


class DataError(P2gdError):
    """A recording, calibration or trajectory file that can't be used."""


class ImageError(DataError):
    """One image that can't be decoded; the others of its recording may be sound."""


class InitializationError(P2gdError):
    """The estimator could not be started; the message gives the value and the threshold."""


class EstimatorError(P2gdError):
    """A back end that can't go on.

    Parameters
    ----------
    stamp_ns
        Time of the image at which it stopped.
    reason
        One sentence.
    """

    def __init__(self, stamp_ns: int, reason: str) -> None:
        super().__init__(f"at {stamp_ns} ns: {reason}")
        self.stamp_ns = stamp_ns
        self.reason = reason
