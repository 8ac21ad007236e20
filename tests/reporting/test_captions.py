"""Captions name what the numbers say: the best model, those that are not told apart from it, and failed runs."""

import numpy as np
import pytest

from pipeline.base import params
from pipeline.reporting import sentences, stability
from pipeline.reporting.page import hypertext
from pipeline.reporting.words import labels
from pipeline.scoring import glove_results
from pipeline.scoring.results import Estimate


def measured(mean: float, half: float = np.nan, failed: int = 0) -> Estimate:
    return Estimate(mean, mean - half, mean + half, 3, failed)


FAR, TIED = {"lomp": measured(4.7, 0.2), "rnn": measured(5.5, 0.2)}, {"rnn": measured(4.701), "lomp": measured(4.699)}


@pytest.mark.parametrize(
    ("errors", "more_is_better", "named", "unnamed"),
    [
        (FAR, False, ["LoMP", "4.7", "RNN is next", "5.5"], ["overlap", "failed"]),
        (FAR, True, ["RNN has", "LoMP is next"], []),
        (FAR | {"rnn": measured(5.0, 0.5)}, False, ["LoMP has", "overlap"], []),
        (TIED, False, ["LoMP and RNN have"], ["next"]),
        (FAR | {"rnn": measured(1.0, failed=1)}, False, ["LoMP is 4.70", "failed for RNN"], ["1.0"]),
    ],
)
def test_a_caption_names_the_best_model_and_what_is_not_told_apart_from_it(errors, more_is_better, named, unnamed):
    text = sentences.best(errors, "error", "kPa", more_is_better=more_is_better)
    assert all(word in text for word in named) and not any(word in text for word in unnamed), text


@pytest.mark.parametrize("line", ["- [a.png](a.png): LoMP is best.", "![a](a.png) LoMP is best."])
def test_the_page_reads_a_figure_and_its_caption(line):
    assert hypertext.captions(f"Text\n\n{line}\n\n[a](b.png)") == {"a.png": "LoMP is best."}


def test_everything_that_params_yaml_names_has_words():
    values = params.load()
    stressed = {name for block in values["stress"].values() for name in block["perturbations"]}
    assert stressed <= set(labels.PERTURBATIONS) and stressed <= set(stability.SEVERITIES)
    effects = {name for key in values["physics"] for name in values[key]["simulate"]["effects"]}
    assert effects <= set(labels.EFFECTS) and set(values["experiments"]) <= set(labels.EXPERIMENTS)
    assert set(labels.FORMS) == set(glove_results.FORMS)
