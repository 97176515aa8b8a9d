"""Coordination of many units: shapes, the assignment of places, movement authorities, and the coordinator."""
