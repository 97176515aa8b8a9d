"""The command link from the computer of a robot to the drive and the lock, with latency and loss."""

from __future__ import annotations

import numpy as np

from msrr_bullet.sensors.schedule import Delayed, duration_ns
from msrr_scenes.messages import Action
from msrr_scenes.specs.vehicle import LinkSpec


class CommandLink:
    """The command link of one unit. After a lost action the last one stays in force."""

    def __init__(self, spec: LinkSpec, rng: np.random.Generator) -> None:
        """Draw the losses from ``rng``, the generator of the stream ``unit/<name>/link``."""
        self._loss = spec.loss
        self._latency_ns = duration_ns(spec.latency_ms * 1e-3)
        self._rng = rng
        self._queue: Delayed[Action] = Delayed()

    @property
    def next_ns(self) -> float:
        """Time at which the next action arrives [ns]."""
        return self._queue.next_ns

    def send(self, action: Action) -> None:
        """Send an action; one number is drawn per action whether or not the link loses any."""
        if self._rng.random() >= self._loss:
            self._queue.send(action.stamp_ns + self._latency_ns, action)

    def arrived(self, now_ns: int) -> Action | None:
        """Return the newest action that has arrived since the last call; None when none has."""
        actions = self._queue.arrived(now_ns)
        return actions[-1] if actions else None
