"""Accuracy and speed of pomona, measured: `python -m benchmarks [NAME ...]`; results in benchmarks/results."""
