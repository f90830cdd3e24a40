"""What a reader sees of a run: tables and figures."""

from __future__ import annotations
