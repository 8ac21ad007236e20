"""Pictures and Markdown, alike in what a sensor's owner and what a reader of the papers sees."""

import os

os.environ["MPLBACKEND"] = "Agg"  # before pyplot is imported; what a notebook sets may not be installed here
