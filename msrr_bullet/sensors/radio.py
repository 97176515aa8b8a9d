"""The radio between the base station and the units: messages arrive late, out of order, or not at all."""

from __future__ import annotations

import numpy as np

from msrr_bullet.sensors.schedule import Delayed, duration_ns
from msrr_scenes.messages import seconds
from msrr_scenes.messages.coordination import Authority, UnitReport
from msrr_scenes.random_streams import stream
from msrr_scenes.specs.mission import RadioSpec


class RadioLink:
    """One direction of the radio for one unit.

    Attributes:
        sent: Number of messages sent.
        lost: Number of messages lost.
    """

    def __init__(self, spec: RadioSpec, unit: str, rng: np.random.Generator) -> None:
        """Draw losses and delays from ``rng``, which no other object uses."""
        self._spec, self._rng = spec, rng
        self._latency_ns = duration_ns(1e-3 * spec.latency_ms)
        self._silences = [s for s in spec.silences if not s.units or unit in s.units]
        self._queue: Delayed[Authority | UnitReport] = Delayed()
        self.sent = self.lost = 0

    def send(self, message: Authority | UnitReport, now_ns: int) -> None:
        """Send a message; two numbers are drawn for each, whatever becomes of it."""
        loss, delay = self._rng.random(2).tolist()
        self.sent += 1
        if loss < self._spec.loss or any(s.from_s <= seconds(now_ns) < s.until_s for s in self._silences):
            self.lost += 1
            return
        jitter_ns = round(delay * duration_ns(1e-3 * self._spec.jitter_ms))
        self._queue.send(now_ns + self._latency_ns + jitter_ns, message)

    def arrived(self, now_ns: int) -> list[Authority | UnitReport]:
        """Remove and return the messages that have arrived by ``now_ns``."""
        return self._queue.arrived(now_ns)


class Radio:
    """All links of a trial.

    Attributes:
        to_units: Link from the base station to each unit.
        from_units: Link from each unit to the base station.
    """

    def __init__(self, spec: RadioSpec, units: tuple[str, ...], seed: int) -> None:
        """Draw from the streams ``radio/<unit>/down`` and ``radio/<unit>/up``."""
        self.to_units = {u: RadioLink(spec, u, stream(seed, f"radio/{u}/down")) for u in units}
        self.from_units = {u: RadioLink(spec, u, stream(seed, f"radio/{u}/up")) for u in units}

    @property
    def sent(self) -> int:
        """Number of messages sent."""
        return sum(link.sent for link in (*self.to_units.values(), *self.from_units.values()))

    @property
    def lost(self) -> int:
        """Number of messages lost."""
        return sum(link.lost for link in (*self.to_units.values(), *self.from_units.values()))
