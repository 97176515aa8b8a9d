"""The interface of the physics that moves and locks the units, and the plant without contact.

This package does not import PyBullet; the plant with contact is in :mod:`msrr_bullet.simulation`.
"""
