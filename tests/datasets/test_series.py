"""Parts of a series in the order of time."""

from pipeline.datasets.series import chronological


def test_validation_is_a_share_of_what_comes_before_the_test_and_at_its_end():
    parts = chronological(1000, train=0.8, validation=0.25).tolist()
    assert parts == ["train"] * 600 + ["validation"] * 200 + ["test"] * 200
