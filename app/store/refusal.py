"""`Refusal`: a request that is understood and refused, with the HTTP status that says so."""

from planner.errors import EchoBaseError
from planner.issues import Issue


class Refusal(EchoBaseError):
    """An `EchoBaseError` that knows how HTTP calls it: 404 not there, 409 not now, 412 changed meanwhile, 413, 507."""

    def __init__(self, status: int, *issues: Issue) -> None:
        super().__init__(*issues)
        self.status = status


def refuse(status: int, code: str, message: str, remedy: str = "", where: str = "") -> Refusal:
    """Return (not raise) a refusal with one issue."""
    return Refusal(status, Issue("error", code, message, remedy, where))


def not_found(what: str, name: object) -> Refusal:
    """Return the refusal for something that does not exist."""
    kind = what.replace(" ", "-")
    return refuse(
        404, f"{kind}-unknown", f"there is no {what} '{name}' here.", "Check the address; it may have been deleted."
    )
