"""The report: one folder that opens offline, with every number shown beside it as JSON."""

from validation.report.write import require, write_report

__all__ = ["require", "write_report"]
