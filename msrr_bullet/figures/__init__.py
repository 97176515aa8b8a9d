"""Figures of a finished run: summary picture, plots, annotated camera frames, and films.

The functions that users call are :func:`msrr_bullet.figures.summary.write_picture`,
:func:`msrr_bullet.figures.plot.write_plot` and :func:`msrr_bullet.figures.frame_files.write_frames`. They are
not imported here because matplotlib takes long to load and only some of them need it.
"""
