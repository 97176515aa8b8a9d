"""Figures of a finished run: summary picture, plots, annotated camera frames, and films.

:mod:`msrr_bullet.figures.plots` draws with matplotlib, :mod:`msrr_bullet.figures.frames` onto what cameras
saw, and :mod:`msrr_bullet.figures.film` shows that and the scene from beside. What they have in common is in
:mod:`msrr_bullet.figures.drawing`.

The functions that users call are :func:`msrr_bullet.figures.plots.summary.write_picture`,
:func:`msrr_bullet.figures.plots.run_plot.write_plot`,
:func:`msrr_bullet.figures.frames.frame_files.write_frames` and
:func:`msrr_bullet.figures.film.film.write_film`. They are not imported here because matplotlib takes long to
load and only plots need it.
"""
