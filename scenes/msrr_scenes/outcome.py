"""The outcome of a trial."""

from __future__ import annotations

from enum import Enum


class Outcome(Enum):
    """The verdict on a trial: what was physically true, and whether the robot knew it.

    The judge forms it from truth; ``false_dock`` and ``false_abort`` are the two ways in which belief and
    truth can differ.
    """

    COMPLETE = "complete"
    """The base station says that the mission is complete, and nothing contradicts it."""
    INCOMPLETE = "incomplete"
    """The base station has given up a part of the mission, and says why."""
    UNDOCKED = "undocked"
    """The lock is open and the unit is clear of the port."""
    STUCK = "stuck"
    """The unit was to undock and is not clear of the port, or its lock is not open."""
    DOCKED = "docked"
    """Seated, locked, the lock held the pull, and the robot says so."""
    JAMMED = "jammed"
    """The pins stopped at the port, too far off its axis to enter."""
    NOT_SEATED = "not_seated"
    """The pins are in line with the holes, or in them and stopped by what plugs them, short of the bottom."""
    LOCK_FAILED = "lock_failed"
    """Seated and closed, but the lock gave way: under the pull, in a tug test of the unit, or later on."""
    TARGET_LOST = "target_lost"
    """The marker was seen and lost, the port was not reached, no attempt was left."""
    GAVE_UP = "gave_up"
    """The marker was detected at least once, nothing stood in the way, and the port was not reached; or the
    drive has seized, or a unit that is clear of a port that it was to leave does not believe it. Tags with
    which no pose agrees count as detected."""
    NEVER_DETECTED = "never_detected"
    """The marker was never seen."""
    BLOCKED = "blocked"
    """The robot found no free path to the target and stopped where it was safe."""
    COLLISION = "collision"
    """Two bodies touched otherwise than the pins of a docking unit and its port. A docking unit that hits its
    target beside the port counts, too."""
    CLEARANCE_VIOLATED = "clearance_violated"
    """Bodies came closer than the scene allows."""
    LEFT_ARENA = "left_arena"
    """The axle of a unit left the arena."""
    ABORTED = "aborted"
    """The trial ended for what happened elsewhere while the step was under way."""
    TIMEOUT = "timeout"
    """The time limit of the scene was reached."""
    PROGRAM_FAILED = "program_failed"
    """A class that the scene names failed, or gave an impossible result."""
    FALSE_DOCK = "false_dock"
    """The robot says docked; the pins are not seated or the lock holds nothing."""
    FALSE_ABORT = "false_abort"
    """The robot gave up, or backed out for good, although the pins were seated in its last attempt, in reach
    of the lock."""
