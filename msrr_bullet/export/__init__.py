"""Export of a run's log as tables for other programs."""

from msrr_bullet.export.csv_files import ExportError, documented_tables, write_csv

__all__ = ["ExportError", "documented_tables", "write_csv"]
