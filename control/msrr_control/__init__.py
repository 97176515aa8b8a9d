"""Control of docking units: from estimates to wheel commands, without images, simulator or truth.

From the bottom up: :mod:`~msrr_control.kinematics`, :mod:`~msrr_control.feedback` (the terms of the laws),
:mod:`~msrr_control.docking` and :mod:`~msrr_control.path_following` (the laws of the two phases),
:mod:`~msrr_control.planning` (routes), :mod:`~msrr_control.sequence` (the phases of a docking step),
:mod:`~msrr_control.coordination` (many units that a base station leads), :mod:`~msrr_control.staging` (the
long-distance phase as a whole) and :mod:`~msrr_control.studies` (unicycle trials).
"""
