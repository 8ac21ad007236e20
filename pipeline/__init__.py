"""Three papers on soft tactile sensing, reproduced from raw serial logs to tables."""

import os

os.environ["MPLBACKEND"] = "Agg"  # figures are files; what a notebook sets may not be installed here
