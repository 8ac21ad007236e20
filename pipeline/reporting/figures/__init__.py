"""Figures of the reports, which are files."""

from tactile.drawing import style as style  # first: it says what pyplot draws with
