"""The one exception of EchoBase: work that failed, with the issues that say why and what to do."""

from planner.issues import Issue


class EchoBaseError(Exception):
    """Raised when work cannot be done. Carries at least one error-level `Issue`; its text is theirs."""

    def __init__(self, *issues: Issue) -> None:
        if not issues:
            raise ValueError("EchoBaseError needs at least one Issue")
        self.issues = tuple(issues)
        super().__init__("\n".join(issue.sentence() for issue in issues))


def fail(code: str, message: str, remedy: str = "", where: str = "") -> EchoBaseError:
    """Return (not raise) the exception for one error-level issue: `raise fail("unit-missing", ...)`."""
    return EchoBaseError(Issue("error", code, message, remedy, where))
