"""The data sheet of a sensor, from its logs alone: what the sensor is worth before any model sees it.

* `sources`: logs of touch, strain and glove, simulated, recorded or your own, as one form, `cycles.Sensor`;
* `cycles`: loading cycles in the log of what pressed, and what every element read in them;
* `estimates`: a value with its bootstrap interval, a bound, or the reason why the logs cannot tell;
* `quantities`: one function for each line of the sheet, which says by which standard it is defined.
"""
