"""Regression check: named quantities of a sensor's fast model, compared with the values in a stored baseline.

`quantities` holds the table of quantities and measures them by `experiments`; `baseline` stores and compares them, and
writes the verdict as JUnit XML.
"""
