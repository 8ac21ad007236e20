"""Write the report on the fit of the Velostat model (pipeline/commands/fit_material.py)."""

from collections.abc import Mapping

import numpy as np

from pipeline.reporting.words import templates


def table(result: Mapping) -> str:
    """Return the report `fit.md`; result: the content of `velostat.json`, which the report rounds."""
    places = {key: np.reshape(result["places"][key], (4, 4)).tolist() for key in ("log_gain", "exponent")}
    ablation = {
        name: [summary(scores[key]) for key in ("exp1", "exp2") for summary in (min, np.mean)]
        for name, scores in result["ablation"].items()
    }
    return templates.render("material", result=result, fitted=result["fit"], grid=places, ablation=ablation)
