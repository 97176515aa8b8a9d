"""Runs the command line with ``python -m msrr_bullet``."""

from msrr_bullet.cli import main

main()
