import numpy as np
import pytest

from msrr_control.docking.barrier import BarrierLaw, BarrierParams
from msrr_control.docking.c1 import C1DockingLaw, C1DockingParams
from msrr_control.docking.law import DockSetup, LawInputs
from msrr_control.feedback.visibility_cone import edge_angles
from msrr_control.studies.docking_study import StartSet, run_study
from msrr_scenes.errors import SceneError
from msrr_scenes.specs.spec import Spread

WILD = StartSet(spread=Spread(x_m=0.05, y_m=0.25, yaw_deg=30.0))


def test_the_target_stays_in_the_cone_where_the_papers_law_loses_it(tight: DockSetup) -> None:
    """Starts up to 25 cm and 30 deg under TIGHT limits: all of 300 kept; the correction keeps about 70 %."""
    result = run_study(BarrierLaw(BarrierParams(), tight), tight, np.random.default_rng(2), 300, WILD)
    assert result.docked.all()
    assert result.in_cone(tight.los.outer).all()
    paper = run_study(C1DockingLaw(C1DockingParams(), tight), tight, np.random.default_rng(2), 300, WILD)
    assert paper.in_cone(tight.los.outer).mean() < 0.85


def test_at_the_barrier_the_edge_moves_no_further_out(facts: DockSetup) -> None:
    """The rate of the edge angle, by finite differences, is at most the envelope's: zero at the barrier."""
    setup = DockSetup(0.1, 0.015, 0.018, facts.los, facts.limits, 50.0)
    law = BarrierLaw(BarrierParams(), setup)
    v, h = 0.1, 1e-6
    for x, y in [(-0.8, 0.1), (-0.5, -0.05), (-0.3, 0.02)]:
        pose = np.array([x, y, 0.0])
        left = edge_angles(pose, setup.los, 0.015)[0]
        pose[2] = left - law._limit
        inputs = LawInputs(pose, edge_angles(pose, setup.los, 0.015), np.array(1.0), np.zeros(2))
        for _ in range(5):  # the camera's lever moves the edge a little when the unit turns
            pose[2] += inputs.edges[0] - law._limit
            inputs = inputs._replace(pose=pose, edges=edge_angles(pose, setup.los, 0.015))
        w = float(law.turn_bounds(np.array(v), inputs)[0])
        moved = pose + h * np.array([v * np.cos(pose[2]), v * np.sin(pose[2]), w])
        rate = (edge_angles(moved, setup.los, 0.015)[0] - inputs.edges[0]) / h
        assert rate == pytest.approx(0.0, abs=2e-3)


def test_a_lost_target_sets_no_barrier(facts: DockSetup) -> None:
    law = BarrierLaw(BarrierParams(), facts)
    pose = np.array([-0.6, 0.05, 0.0])
    seen = LawInputs(pose, np.array([0.6, 0.5]), np.array(1.0), np.zeros(2))
    lost = seen._replace(visibility=np.array(0.0))
    assert law.step(law.start(seen), seen, 0.02)[0][1] > 0.0
    assert law.step(law.start(lost), lost, 0.02)[0][1] < 0.0


def test_a_margin_wider_than_the_cone_is_refused(facts: DockSetup) -> None:
    with pytest.raises(SceneError, match="leaves nothing"):
        BarrierLaw(BarrierParams(margin_deg=40.0), facts)
