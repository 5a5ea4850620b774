"""Exact solutions and boundary elements that only tests and benchmarks compare with."""
