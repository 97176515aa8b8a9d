"""The command line ``msrr``."""

from msrr_bullet.cli.app import main

__all__ = ["main"]
