"""The command line ``msrr``: commands, options, console output and exit codes."""

from msrr_bullet.cli.app import main

__all__ = ["main"]
