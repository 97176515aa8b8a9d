"""Plots by matplotlib: summary of a trial, curves over time, views from above, and the style of studies."""
