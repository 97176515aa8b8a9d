"""The command line ``msrr``."""
