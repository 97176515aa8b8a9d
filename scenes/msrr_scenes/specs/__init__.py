"""Specifications: the frozen, validated models of everything that a scene file can say.

One field of a model is one key of a scene file, and the docstring below the field describes the key.
"""
