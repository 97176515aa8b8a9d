"""How far the solver of PyBullet converges in a tick."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from msrr_bullet.silent_pybullet import pybullet

#: Largest change of a velocity, at a contact or joint, by the last iteration [m/s]. A trial then leads units
#: to where it would without this bound, but for less than four times as many ticks would change.
CONVERGED_MPS = 1e-3

#: Most iterations, which contact may need: with 50 a unit that jams at the mouth is pressed in and the target
#: creeps away by millimetres; 400 change a trial by no more than 150.
MOST_ITERATIONS = 150


def configure_solver(client: int) -> None:
    """Let the solver of a client stop where it has converged."""
    pybullet.setPhysicsEngineParameter(
        numSolverIterations=MOST_ITERATIONS,
        solverResidualThreshold=CONVERGED_MPS**2,
        physicsClientId=client,
    )


@contextmanager
def exact_forces(client: int) -> Iterator[None]:
    """Let the solver of a client do all of its iterations within the block, for forces.

    Where it stops at ``CONVERGED_MPS``, the force of a lock is off by up to 0.2 N.
    """
    pybullet.setPhysicsEngineParameter(solverResidualThreshold=0.0, physicsClientId=client)
    try:
        yield
    finally:
        configure_solver(client)
