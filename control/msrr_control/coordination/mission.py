"""Missions: what the coordinator is to reach, as a shape or as tasks, and how it works."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from msrr_control.shapes.shape import Shape
from msrr_scenes.specs.plan import PlanStep


@dataclass(frozen=True)
class Patience:
    """How long the coordinator waits for what.

    Attributes:
        rate_hz: Authorities per second and unit.
        expires_s: Time after which an authority ends unless it is renewed.
        seen_s: Time for which the first sight of all units is waited for.
        unseen_s: Time for which a sight of a unit that says that it has arrived is waited for, and for which
            one that is seen elsewhere may still correct where it stands.
        retry_s: Time between two attempts to find routes past those who are under way.
        look_again_s: Time between two attempts when nothing that is known of has changed.
        stalled_s: Time without any progress after which routes are planned anew.
        silent_s: Time since the newest report from which on no such time is counted.
        unheard_s: Time without a report after which a unit under way on free ground counts as lost.
        held_s: Time for which a unit says that it stands on free ground after which it gets another route.
        recalls: How often a unit gets another route for that before another task is done.
        lost_s: Time without progress on free ground after which a unit counts as failed, and time for which
            tasks that nobody else can do wait for a unit that is lost, or was never seen, and a shape for the
            first sight of its root.
        dock_s: Time in the dock leg for which a unit stands without progress after which it counts as failed,
            and without a report after which it counts as lost. It may try more than once meanwhile.
        tries_s: Time without progress in the dock leg for which a unit may go on trying.
        hopeless_s: Time without a route for anybody after which a task is given up.
        replans: Largest number of times that routes are planned anew before another task is done.
    """

    rate_hz: float = 5.0
    expires_s: float = 3.0
    seen_s: float = 5.0
    unseen_s: float = 2.0
    retry_s: float = 2.0
    look_again_s: float = 4.0
    stalled_s: float = 6.0
    silent_s: float = 1.5
    unheard_s: float = 60.0
    held_s: float = 8.0
    recalls: int = 2
    lost_s: float = 30.0
    dock_s: float = 150.0
    tries_s: float = 900.0
    hopeless_s: float = 5.0
    replans: int = 12


@dataclass(frozen=True)
class Mission:
    """What is to be reached: a shape that is built anywhere, or a plan of steps.

    Attributes:
        shape: The shape; None for a plan.
        named: Whether the places of the shape are named by the units that have to take them.
        steps: The steps of the plan, for a mission without a shape.
        one_by_one: Whether only one unit may be under way at a time, for comparison.
        holders: Port ``<unit>.<port>`` that each unit is locked to at the start.
        name: Name of the shape, for the status.
        then: What is to be reached once the shape is complete, from the docks that the units have reported by
            then; None if that is all.
    """

    shape: Shape | None = None
    named: bool = False
    steps: Sequence[PlanStep] = ()
    one_by_one: bool = False
    holders: Mapping[str, str] = field(default_factory=dict)
    name: str = ""
    then: Mission | None = None

    @property
    def later_shapes(self) -> list[Shape]:
        """The shapes that are built from this one, in their order."""
        if self.then is None or self.then.shape is None:
            return []
        return [self.then.shape, *self.then.later_shapes]
