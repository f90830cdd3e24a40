"""What the doctor says: findings and a verdict."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

Status = Literal["ok", "note", "undetermined", "warning", "fault"]
Value = float | int | str | bool | None

FIT = "fit to run"
FIT_WITH_WARNINGS = "fit to run, with warnings"
NOT_FIT = "not fit to run"
TOO_LITTLE = "too little data to judge"


@dataclass(frozen=True, slots=True)
class Finding:
    """One check and what came of it.

    Attributes
    ----------
    check
        What was looked at, two or three words.
    status
        ``note`` and ``undetermined`` don't touch the verdict.
    value
        What was found, one sentence or less.
    threshold
        What it was held against.
    mend
        What to do about it; empty where there is nothing to do.
    fault
        Short snake_case name of the fault for scripts, None where there is none.
    data
        Numbers for scripts.
    """

    check: str
    status: Status
    value: str
    threshold: str = ""
    mend: str = ""
    fault: str | None = None
    data: dict[str, Value] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Report:
    """All findings about a recording.

    Attributes
    ----------
    name
        Of the recording.
    findings
        In the order in which they were made.
    seconds
        Wall time that it took.
    enough
        Whether there is enough data for a verdict.
    """

    name: str
    findings: tuple[Finding, ...]
    seconds: float
    enough: bool = True

    @property
    def verdict(self) -> str:
        """One of :data:`FIT`, :data:`FIT_WITH_WARNINGS`, :data:`TOO_LITTLE`, :data:`NOT_FIT`."""
        statuses = {finding.status for finding in self.findings}
        if "fault" in statuses:
            return NOT_FIT
        if not self.enough:
            return TOO_LITTLE
        return FIT_WITH_WARNINGS if "warning" in statuses else FIT

    @property
    def faults(self) -> tuple[str, ...]:
        """Names of the faults, warnings included."""
        return tuple(
            finding.fault
            for finding in self.findings
            if finding.fault is not None and finding.status in ("fault", "warning")
        )

    def to_json(self) -> dict[str, object]:
        """Everything, for scripts."""
        return {
            "name": self.name,
            "verdict": self.verdict,
            "faults": list(self.faults),
            "seconds": round(self.seconds, 2),
            "findings": [
                {
                    "check": f.check, "status": f.status, "value": f.value,
                    "threshold": f.threshold, "mend": f.mend, "fault": f.fault, "data": f.data,
                }
                for f in self.findings
            ],
        }  # fmt: skip
