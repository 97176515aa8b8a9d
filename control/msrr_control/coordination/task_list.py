"""The tasks of a mission as they stand: open, granted, done or given up."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from msrr_control.shapes.tasks import Task, TaskState

#: Number of units that may fail in the leg into a port before the task is given up: the port may be to blame.
_MOST_FAILURES = 3


class TaskList:
    """Keeps the state of every task, and gives up what depends on a task that is given up."""

    def __init__(self, tasks: Sequence[Task]) -> None:
        """Begin with all tasks open, in an order in which they can be granted."""
        self.by_name = {task.name: task for task in tasks}
        self._states = {task.name: TaskState.OPEN for task in tasks}
        self._failures = {task.name: 0 for task in tasks}
        self._misses: Counter[tuple[str, str]] = Counter()
        self.reasons: dict[str, str] = {}
        self._done: set[str] = set()  # also those that were undone since
        self._hopeless: set[str] = set()  # given up because nobody could do them then, or with one of those

    def state(self, name: str) -> TaskState:
        """Return how a task stands."""
        return self._states[name]

    def names(self, *states: TaskState) -> tuple[str, ...]:
        """Return the names of the tasks in these states, in the order of the tasks."""
        return tuple(name for name, state in self._states.items() if state in states)

    @property
    def open(self) -> list[Task]:
        """The open tasks, in the order in which they can be granted."""
        return [self.by_name[name] for name in self.names(TaskState.OPEN)]

    @property
    def ended(self) -> bool:
        """Whether every task is done or given up."""
        return not self.names(TaskState.OPEN, TaskState.GRANTED)

    def ready(self) -> list[Task]:
        """Return the open tasks that can be granted now, as far as other tasks tell."""
        return [
            task
            for task in self.open
            if all(self._states[name] is TaskState.DONE for name in task.after)
            and self._open_before(task) is None
        ]

    def grant(self, name: str) -> None:
        """Note that a unit has a route for the task."""
        self._states[name] = TaskState.GRANTED

    def finish(self, name: str) -> None:
        """Note that the task is done."""
        self._states[name] = TaskState.DONE
        self._done.add(name)

    @property
    def advance(self) -> int:
        """How many tasks have been done; one that was undone and done again counts once."""
        return len(self._done)

    def reopen(self, name: str) -> None:
        """Note that the unit has lost its route for the task."""
        if self._states[name] is TaskState.GRANTED:
            self._states[name] = TaskState.OPEN

    def miss(self, name: str, unit: str) -> None:
        """Note that a unit has driven its route for the task and does not stand where it should."""
        self.reopen(name)
        self._misses[name, unit] += 1

    def misses(self, name: str, unit: str) -> int:
        """Return how often a unit has missed where a task ends."""
        return self._misses[name, unit]

    def undo(self, name: str) -> None:
        """Note that the unit of a task that was done is not where it led any more; it is open again."""
        if self._states[name] is TaskState.DONE:
            self._states[name] = TaskState.OPEN

    def fail(self, name: str, reason: str, in_dock_leg: bool) -> None:
        """Note that the unit failed; the task is open for another one, unless none may do it.

        It is given up, too, if too many units have failed in the leg into its port.
        """
        if self._states[name] is not TaskState.GRANTED:
            return
        self._failures[name] += in_dock_leg
        self._states[name] = TaskState.OPEN
        if self.by_name[name].unit is not None or self._failures[name] >= _MOST_FAILURES:
            self.give_up(name, reason)

    def give_up(self, name: str, reason: str, hopeless: bool = False) -> None:
        """Give up an open task, and all that depend on it.

        It is ``hopeless`` if nobody can do it now; then it is not given up for good.
        """
        if self._states[name] is not TaskState.OPEN:
            return
        self._states[name] = TaskState.GIVEN_UP
        self.reasons[name] = reason
        if hopeless:
            self._hopeless.add(name)
        self._give_up_after(name, hopeless)

    def take_up_again(self) -> None:
        """Open the tasks that nobody could do: there is a unit more now. Those given up for good stay so."""
        for name in self._hopeless:
            self._states[name] = TaskState.OPEN
            del self.reasons[name]
        self._hopeless.clear()
        for name in self.names(TaskState.GIVEN_UP):
            self._give_up_after(name)

    def _give_up_after(self, name: str, hopeless: bool = False) -> None:
        """Give up all that depend on a task that is given up."""
        for task in self.by_name.values():
            if name in task.depends_on:
                self.reopen(task.name)
                self.give_up(task.name, f"needs {name}", hopeless)

    def lost_base(self, name: str) -> str | None:
        """Return a task whose loss takes the route from the unit of a granted one; None if there is none.

        Its unit needs that task, or would close the lane of the unit that does it.
        """
        granted = self._states[name] is TaskState.GRANTED
        return self._open_before(self.by_name[name]) if granted else name

    def _open_before(self, task: Task) -> str | None:
        """Return an open task that has to be granted before this one, through any number of others."""
        queue = [*task.depends_on, *task.behind]
        known = set(queue)
        for name in queue:  # the list grows while it is walked
            if self._states[name] is TaskState.OPEN:
                return name
            before = self.by_name[name]
            for further in (*before.depends_on, *before.behind):
                if further not in known:
                    known.add(further)
                    queue.append(further)
        return None
