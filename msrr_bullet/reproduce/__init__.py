"""The paper's two experiments beside ours: figures, panels, the map over gain and delay, ablations."""
