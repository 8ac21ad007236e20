"""The models of the results tables, one file per row: `build(spec, *, <settings of its block in params.yaml>)`."""

import importlib
from collections.abc import Mapping

from pipeline.base import params


def build(key: str, spec, settings: Mapping, where: str):
    """Return the model of `pipeline/models/<key>.py`, built for `spec` with its block of params.yaml.

    Raises InputError when there is no such file or when the block does not fit `build`'s signature.
    """
    return importlib.import_module(f"pipeline.models.{key}").build(
        spec, **dict(params.check_model(key, settings, where))
    )
