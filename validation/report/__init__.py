"""The report on a sensor's evaluation: a folder with a page that opens offline, and the page's numbers as JSON."""

from validation.report.write import require, write_report

__all__ = ["require", "write_report"]
