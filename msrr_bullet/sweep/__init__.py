"""Sweeps: many trials of one scene, kept in a store, and their summary."""

from msrr_bullet.sweep.provenance import code_fingerprint
from msrr_bullet.sweep.summary import SweepSummary, TrialFailure
from msrr_bullet.sweep.trial_store import StoreError, TrialStore

__all__ = ["StoreError", "SweepSummary", "TrialFailure", "TrialStore", "code_fingerprint"]
