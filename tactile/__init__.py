"""Three papers on soft tactile sensing, reproduced from raw serial logs to tables."""
