"""A made-up table of the long-distance phase."""

import numpy as np

from msrr_bullet.studies.model import Measured, Row, Table, rates_of


def passing(label: str, trials: int = 2, *, clear: bool = True, **figures: float) -> Row:
    """Return a row of trials with the same figures, which pass the obstacle or drive through it."""
    measures = {key: Measured.of([value] * trials) for key, value in figures.items()}
    success = rates_of(success=np.full(trials, clear))
    return Row(controller=label.lower(), label=label, trials=trials, **success, measures=measures)


#: C1 passes on its path and is hardly behind the desired point, and C2 waits.
LONG = Table(
    phase="long",
    plant="unicycle",
    setting="standard",
    description="here",
    rows=(
        passing("C1", amplitude=0.25, amplitude_path=0.24, recovery=2.2, recovery_path=2.1),
        passing("C2", amplitude=0.51, amplitude_path=0.26, recovery=3.5, recovery_path=2.3),
    ),
)
