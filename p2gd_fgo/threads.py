"""Thread counts of the numeric libraries.

BLAS and OpenMP read their environment when they are loaded, so this module imports none of them
and :func:`set_thread_environment` must run before the first import of numpy.
"""

from __future__ import annotations

import os
import sys

_VARIABLES = (
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "NUMEXPR_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
    "NUMBA_NUM_THREADS",
    "OPENCV_FOR_THREADS_NUM",
)


def thread_environment(threads: int) -> dict[str, str]:
    """The variables that give every numeric library ``threads`` threads."""
    return dict.fromkeys(_VARIABLES, str(threads))


def set_thread_environment(threads: int) -> bool:
    """Ask BLAS and OpenMP for ``threads`` threads.

    Returns
    -------
    bool
        Whether that came in time: False if numpy has been loaded already.
    """
    os.environ.update(thread_environment(threads))
    return "numpy" not in sys.modules
