"""Figures of a finished run: summary picture, plots, annotated camera frames, and films.

The functions that users call are :func:`msrr_bullet.figures.summary.write_picture`,
:func:`msrr_bullet.figures.plot.write_plot`, :func:`msrr_bullet.figures.frame_files.write_frames` and
:func:`msrr_bullet.figures.film.write_film`. They are not imported here because matplotlib takes long to load
and only some of them need it.
"""
