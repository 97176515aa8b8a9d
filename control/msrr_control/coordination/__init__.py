"""Coordination of many units: the coordinator assigns places and grants each unit the ground to drive on."""
