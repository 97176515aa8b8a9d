"""Batches of simulated unicycles: a controller in a setting as figures, over time, or tuned."""

from msrr_bullet.studies.docking_studies import docking_row, docking_series
from msrr_bullet.studies.gain_delay import gain_delay_map
from msrr_bullet.studies.path_following_studies import path_following_row, path_following_series
from msrr_bullet.studies.settings import Setting

__all__ = [
    "Setting",
    "docking_row",
    "docking_series",
    "gain_delay_map",
    "path_following_row",
    "path_following_series",
]
