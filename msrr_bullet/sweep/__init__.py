"""Sweeps: many trials of one scene, kept in a store, and their summary."""
