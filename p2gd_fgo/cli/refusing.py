"""Errors as one sentence on stderr, for the commands and for scripts beside them."""

from __future__ import annotations

import sys
from collections.abc import Callable

from rich.console import Console

from p2gd_fgo.errors import P2gdError


def run_refusing(body: Callable[[], None]) -> None:
    """Run the body of a program; exit with 2 after a sentence on bad input, with 130 on Ctrl-C."""
    try:
        body()
    except P2gdError as error:
        console = Console(stderr=True, soft_wrap=True, highlight=False, markup=False, emoji=False)
        console.print(f"p2gd-fgo: {error}")
        sys.exit(2)
    except KeyboardInterrupt:
        sys.exit(130)
