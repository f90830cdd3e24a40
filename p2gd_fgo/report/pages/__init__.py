"""The report of many runs: one content, as terminal text, Markdown, LaTeX and an HTML page."""

from __future__ import annotations
