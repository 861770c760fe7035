"""`Issue`: the one shape of everything EchoBase has to say about its input or its output."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

Severity = Literal["error", "warning", "info"]


@dataclass(frozen=True)
class Issue:
    """One finding.

    `code` is a stable kebab-case name (`unit-missing`), `message` says what is wrong, `remedy` what to do about it,
    `where` names the place (`setup.json: probe.pitch_mm`, `K3`, `pass 12 pose 40`, `EB_SCAN.src:31`).
    """

    severity: Severity
    code: str
    message: str
    remedy: str = ""
    where: str = ""

    def sentence(self) -> str:
        """Return the finding as one line for a person."""
        place = f"{self.where}: " if self.where else ""
        remedy = f" {self.remedy}" if self.remedy else ""
        return f"{place}{self.message}{remedy}"

    def to_json(self) -> dict[str, str]:
        """Return the finding as JSON fields."""
        return {
            "severity": self.severity,
            "code": self.code,
            "message": self.message,
            "remedy": self.remedy,
            "where": self.where,
        }


def errors_in(issues: Iterable[Issue]) -> list[Issue]:
    """Return the issues of severity `error`."""
    return [issue for issue in issues if issue.severity == "error"]
