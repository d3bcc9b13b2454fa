"""What the goals ask that is not planned for."""

from core.interfaces import Task


def find_unplanned(task: Task, seed: int) -> list[str]:
    return []
