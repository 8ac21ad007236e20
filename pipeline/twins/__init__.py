"""Describe recordings and their simulated scenes by the same model-free statistics. Each module provides:

* `STATISTICS`: statistic -> (unit, what it is).
* `recorded(workspace, settings)`, `simulated(workspace, settings)` -> a data frame with the columns `recording`,
  `statistic` and `value`, one row per recording and statistic; settings: all of params.yaml.
* `NOTES`: statistic -> what is done about a simulated value outside the recorded range.
"""
