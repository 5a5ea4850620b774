"""The report: a folder with a page that opens offline, and every number of the page as JSON."""

from validation.report.write import require, write_report

__all__ = ["require", "write_report"]
