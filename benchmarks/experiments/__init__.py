"""The paper's experiments on rendered videos, one a file: `python -m benchmarks.experiments [FOLDER]`."""
