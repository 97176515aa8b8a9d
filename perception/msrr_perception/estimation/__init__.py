"""Estimation: the pose of a unit against its target by tag corners and wheels, and the line of sight to it.

``estimator`` has the protocol and ``corner_filter`` what implements it. The filter keeps its measurements in
the order of their exposures (``measurement_history``) and takes one after the other (``filter_step``): the
wheels move its state (:mod:`msrr_perception.motion`), and ``corner_update`` starts or corrects it.

The package root exports nothing: its modules load numba, OpenCV and SciPy.
"""
