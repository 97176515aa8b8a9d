"""A finished run as a sequence of snapshots, as camera views and as time series, all read from its log.

Viewer, figures and export show what this package holds, in the colours of
:mod:`msrr_bullet.timeline.palette`. A running trial passes the same snapshots to a viewer.
"""
