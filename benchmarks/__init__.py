"""What the documentation says about accuracy and speed, measured: `python -m benchmarks` or `make bench`."""
