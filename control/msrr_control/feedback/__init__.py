"""The terms of the laws as pure functions, each with its equation, source and correction.

No function here knows of a phase; :mod:`msrr_control.docking` and :mod:`msrr_control.path_following` combine
them.
"""
