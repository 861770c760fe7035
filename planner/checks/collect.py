"""Many poses with one fault make one issue: how many, how bad, and where it begins."""

import numpy as np
from numpy.typing import NDArray

from planner.frames import Array
from planner.issues import Issue, Severity
from planner.toolpath import Role, ToolPath


def place(path: ToolPath, index: int) -> str:
    """Return the name of a pose for people: pass from 1, position in the pass from 1, and its role."""
    pass_id = int(path.pass_id[index])
    first = int(np.argmax(path.pass_id == pass_id))
    role = Role(int(path.role[index])).name.lower().replace("_", "-")
    return f"{path.kind} pass {pass_id + 1} pose {index - first + 1} ({role})"


def collapse(
    path: ToolPath,
    bad: NDArray[np.bool_],
    severity: Severity,
    code: str,
    message: str,
    remedy: str,
    worst: Array | None = None,
) -> list[Issue]:
    """Return no issue, or one for all the poses of `bad` (n,).

    `message` may hold {count}, {of} and {worst}; {of} counts the poses of the path, {worst} is the largest `worst` (n,)
    over the bad poses.
    """
    count = int(np.count_nonzero(bad))
    if count == 0:
        return []
    top = float("nan") if worst is None else float(np.nanmax(np.where(bad, worst, np.nan)))
    text = message.format(count=count, of=len(bad), worst=top)
    return [Issue(severity, code, text, remedy, place(path, int(np.argmax(bad))))]
