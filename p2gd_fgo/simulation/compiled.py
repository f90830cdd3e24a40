"""One decorator for all compiled kernels."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar, cast

import numba

F = TypeVar("F", bound=Callable[..., object])


def compiled(function: F) -> F:
    """Compile a kernel on its first call, and keep the machine code between processes.

    No fast-math, so that equal input gives equal bytes.
    """
    return cast(F, numba.njit(cache=True, error_model="numpy")(function))
