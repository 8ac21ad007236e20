"""Where the code lies, and what came with it: a checkout has it beside the code, an installed wheel inside."""

from pathlib import Path

CODE = Path(__file__).parents[1]
INSTALLED = CODE / "brought"  # of an installed wheel: copies of what a checkout has beside the code
BROUGHT = INSTALLED if INSTALLED.is_dir() else CODE.parent
PACKAGE = "tactile-reproduction"  # as pip knows it
