"""Every figure and table of the paper: `python -m reproduce`, or `make reproduce`."""
