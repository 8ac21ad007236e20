"""What the strain reports say must follow from the numbers, whatever they are."""

import numpy as np
import pytest

from pipeline.scoring import published, strain_results


def test_error_is_over_the_outputs_that_were_asked_for():
    truth = np.array([[3.0, 4.0, 7.0]])
    assert strain_results.mean_error(truth, np.array([[0.0, 0.0, np.nan]])) == pytest.approx(5.0)
    assert strain_results.mean_error(truth, np.array([[np.nan, np.nan, 5.0]])) == pytest.approx(2.0)


def test_published_table_is_read():
    assert published.latent("lstm_direct", "task_1", "parameters") == 11450
    assert published.latent("lstm_transfer", "task_2", "test error") == 26
    assert np.isnan(published.latent("ridge", "task_2", "test error"))
