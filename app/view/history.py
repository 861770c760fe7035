"""Undo and redo of key points: every set that was in force, whoever made it."""

from collections.abc import Iterable

from planner.keypoint import KeyPoint

Points = tuple[KeyPoint, ...]
LIMIT = 200


class History:
    """A line of key-point sets with a place on it; an edit after an undo forgets what was undone."""

    def __init__(self, sets: Iterable[Points], limit: int = LIMIT) -> None:
        """sets: what was in force so far, oldest first, the present one last; at least one."""
        first, *later = sets
        self._sets: list[Points] = [first]
        self._at = 0
        self._limit = limit
        for points in later:
            self.note(points)

    @property
    def undos(self) -> int:
        """How many steps can be undone."""
        return self._at

    @property
    def redos(self) -> int:
        """How many steps can be redone."""
        return len(self._sets) - 1 - self._at

    def note(self, points: Points) -> None:
        """Record the set now in force; nothing happens if it is the one already recorded."""
        if points == self._sets[self._at]:
            return
        self._sets = [*self._sets[: self._at + 1], points][-self._limit :]
        self._at = len(self._sets) - 1

    def step(self, by: int) -> Points | None:
        """Move by -1 (undo) or +1 (redo) and return the set to put in force, or None at the end of the line."""
        target = self._at + by
        if not 0 <= target < len(self._sets):
            return None
        self._at = target
        return self._sets[target]
