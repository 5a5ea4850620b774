"""The report on a sensor's evaluation: a folder with a page that opens offline, and the page's numbers as JSON."""

from validation.report.page import write_report

__all__ = ["write_report"]
