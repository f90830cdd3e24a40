"""Many runs that answer one question: what they are, where they run, and what is kept of them."""

from __future__ import annotations
