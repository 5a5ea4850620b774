"""Regression check: named quantities of a sensor's fast model, compared with the values in a stored baseline.

`quantities` holds the table of quantities and measures them, `baseline` stores and compares them, `junit` writes the
verdict for CI.  The other modules hold the experiments, simulated or computed, that give the values.
"""
