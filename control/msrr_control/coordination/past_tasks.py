"""What has become of tasks that others have taken the place of: those of a shape before, and other hops."""

from __future__ import annotations

from collections.abc import Callable, Collection

from msrr_control.coordination.task_list import TaskList
from msrr_control.shapes.tasks import Task, TaskState


class PastTasks:
    """Keeps the tasks of all lists before the present one.

    Attributes:
        done: Names of those that were done, in their order.
        undone: Why hops were not made whose units do not hop any more and leave places empty, by unit and
            task.
    """

    def __init__(self) -> None:
        """Begin with the first list of tasks."""
        self.done: tuple[str, ...] = ()
        self.undone: dict[tuple[str, str], str] = {}

    def finish(self, tasks: TaskList) -> None:
        """Note which tasks of a list were done, after which another one begins."""
        self.done += tasks.names(TaskState.DONE)

    def replace(
        self,
        tasks: TaskList,
        hopping: Collection[str],
        out: Collection[str],
        whole: bool,
        why: Callable[[Task], str],
    ) -> None:
        """Note which hops of a list are not made because other hops take their place.

        The units in ``hopping`` hop otherwise, and those in ``out`` count as missing in their places.
        ``whole`` is whether all places are taken after that, and ``why`` says why nobody can do an open task.
        """
        undone = dict(self.undone)
        for name in tasks.names(TaskState.OPEN, TaskState.GIVEN_UP):
            task = tasks.by_name[name]
            undone[str(task.unit), name] = tasks.reasons.get(name) or why(task)
        left = {
            (unit, name): reason
            for (unit, name), reason in undone.items()
            if unit in out or not (whole or unit in hopping)
        }
        self.undone = left or ({} if whole else undone)
        self.finish(tasks)
