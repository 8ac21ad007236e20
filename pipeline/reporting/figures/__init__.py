"""Figures, which are files."""

import os

os.environ["MPLBACKEND"] = "Agg"  # before pyplot is imported; what a notebook sets may not be installed here
