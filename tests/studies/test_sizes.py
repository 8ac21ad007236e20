"""What size of a ladder is enough, and that its rungs are the papers' own models."""

import json

import numpy as np
import pandas as pd
import pytest
import torch

from pipeline.claims import sizes as sizes_verdicts
from pipeline.claims.sizes import Reference
from pipeline.reporting import tables
from pipeline.reporting.figures import sizes as sizes_figures
from pipeline.results import shards, studies
from pipeline.results.claim_inputs import FULL, KEY
from pipeline.results.one_table import Results
from tactile.base.errors import InputError
from tactile.learning.residual_blocks import separable_network
from tactile.models import sp_resnet
from tactile.scoring.estimates import SHARE, estimate

NAN = float("nan")


@pytest.mark.parametrize(
    ("errors", "verdicts"),
    [
        ({8: [9, 11.1, 13.4], 16: [4.11, 5.1, 6.2], 32: [4, 5, 6]}, ["too small", "enough", "best"]),  # 2 to 3 % above
        ({8: [9, 11.1, 13.4], 16: [4.1, 5.6, 6.0], 32: [4, 5, 6]}, ["too small", "inconclusive", "best"]),
        ({16: [1.1, 1.05], 32: [1, 1]}, ["inconclusive", "best"]),
        ({8: [5, NAN, 5], 16: [5.2, 5.15, 5.1], 32: [5, 5.1, 5.2]}, ["failed", "inconclusive", "best"]),
        ({8: [1, NAN], 16: [9, 9]}, ["failed", "best"]),  # a size with a failed run is not the best
        ({8: [5.0], 16: [4.9]}, ["inconclusive", "best"]),  # one run has no interval
        ({8: [np.inf, 1], 16: [NAN, NAN]}, ["failed", "failed"]),
    ],
)
def test_a_size_is_enough_where_it_is_certainly_within_5_percent_of_the_best(errors, verdicts):
    found = sizes_verdicts.excesses(errors)
    assert [sizes_verdicts.verdict(found.get(size)) for size in errors] == verdicts


def runs(family, metric, unit, values, condition="single"):
    """The runs of a ladder; values: size -> a value a seed."""
    experiment = studies.FAMILIES[family].experiment
    rows = [
        (experiment, condition, family, float(size), 100 * size, metric, unit, seed, value, 1000 * size)
        for size, ones in values.items()
        for seed, value in enumerate(ones)
    ]
    return pd.DataFrame(rows, columns=studies.LADDER)


def test_judged_rows_have_means_intervals_and_one_choice():
    judged = sizes_verdicts.judge(runs("lomp", "rmse", "kPa", {128: [4, 5, 6], 8: [9, NAN, 9], 32: [4.1, 5.1, 6.2]}))
    assert list(judged["size"]) == [8, 32, 128] and list(judged["chosen"]) == [0, 1, 0]
    assert list(judged["verdict"]) == ["failed", "enough", "best"]
    assert judged["excess"].tolist()[1:] == pytest.approx([np.mean([0.1 / 4, 0.1 / 5, 0.2 / 6]), 0])
    assert list(judged["failed"]) == [1, 0, 0] and list(judged["runs"]) == [2, 3, 3]
    logs = np.log([4, 5, 6])  # an error has its interval above zero
    half = 4.302652729911275 * logs.std(ddof=1) / np.sqrt(3)  # t of 2 degrees of freedom
    assert judged.iloc[2][["value", "low", "high"]].tolist() == pytest.approx(
        np.exp(logs.mean() + [0, -half, half]).tolist()
    )
    assert list(judged["params"]) == [800, 3200, 12800]


def test_a_ladder_is_compared_with_the_trained_model_on_its_own_seeds():
    ladder = runs("lstm", "error", "mm", {5: [3, 4], 50: [1, 2]}, condition="task_1")
    kept = pd.DataFrame(
        [("strain", "task_1", "task_1", model, "", "error", "mm", seed, FULL, value)
         for model, values in {"lstm_direct": [1, 2, 9], "constant": [5, 6, 90]}.items()
         for seed, value in enumerate(values)],
        columns=[*KEY, "unit", "seed", "budget", "value"],
    )  # fmt: skip
    found = sizes_verdicts.references(Results(kept.assign(n=1)), ladder)
    assert found == {("lstm", "task_1"): Reference(constant=pytest.approx(30**0.5), trained=pytest.approx(2**0.5))}


def test_of_a_fraction_more_is_better():
    fractions = runs(
        "sp_resnet", "macro_precision", "1", {0.25: [0.5, 0.51, 0.52], 0.5: [0.88, 0.89, 0.9], 1: [0.8, 0.9, 0.85]}
    )
    judged = sizes_verdicts.judge(fractions)
    assert list(judged["chosen"]) == [0, 1, 0]
    _, low, high, *_ = estimate([0.88, 0.89, 0.9], SHARE)
    assert tables.ladder_cells(judged.iloc[1])[0] == f"11.00 [{100 * (1 - high):.2f}, {100 * (1 - low):.2f}]"


def test_conditions_are_judged_apart():
    both = [
        runs("lomp", "rmse", "kPa", values, condition)
        for condition, values in (("single", {8: [1, 1], 16: [2, 2]}), ("double", {8: [2, 2], 16: [1, 1]}))
    ]
    judged = sizes_verdicts.judge(pd.concat(both))
    assert set(zip(judged[judged.chosen == 1].condition, judged[judged.chosen == 1]["size"], strict=True)) == {
        ("single", 8),
        ("double", 16),
    }


def test_failed_runs_are_said_in_table_and_figure(tmp_path):
    judged = sizes_verdicts.judge(
        runs("lomp", "rmse", "kPa", {8: [NAN, NAN, NAN], 32: [NAN, 4.0, 4.0], 128: [5, 6, 5.5]})
    )
    assert [[row[0], *row[3:]] for row in tables.rightsize(judged).rows] == [
        ["8", "failed (3 of 3 runs)", "failed"],
        ["32", "failed (1 of 3 runs); others 4.00", "failed"],
        ["128 (published)", "5.48 [4.37, 6.88]", "best*"],
    ]
    pictures = []
    for name in ("one.png", "two.png"):
        sizes_figures.curves(tmp_path / name, "Touch", judged, {("lomp", "single"): Reference(11.0, 3.4)})
        pictures.append((tmp_path / name).read_bytes())
    assert pictures[0] == pictures[1]


def test_intervals_of_the_figure_are_those_of_the_table(tmp_path, monkeypatch):
    """Those of a precision are no mirror image about their mean, and an error of 100 % less it turns them round."""
    judged = sizes_verdicts.judge(
        runs("sp_resnet", "macro_precision", "1", {0.5: [0.8, 0.9, 0.86], 1: [0.8, 0.9, 0.85]})
    )
    seen = []
    monkeypatch.setattr(sizes_figures.style, "save", lambda figure, path: seen.append(figure))
    sizes_figures.curves(tmp_path / "one.png", "Glove", judged, {("sp_resnet", "single"): Reference(99.0, NAN)})
    (bars,) = seen[0].axes[0].containers
    drawn = [segment[:, 1] for segment in bars[2][0].get_segments()]
    assert drawn == [pytest.approx([100 * (1 - row.high), 100 * (1 - row.low)]) for row in judged.itertuples()]


def test_full_width_is_the_published_network():
    x = torch.randn(2, 1, 32, 32)
    networks = []
    for make in (lambda: sp_resnet.network(1, 16, 16, 1.0), lambda: separable_network(1, 16, 16)):
        torch.manual_seed(0)
        networks.append(make().eval())
    ours, published = networks
    assert [weight.shape for weight in ours.parameters()] == [weight.shape for weight in published.parameters()]
    assert torch.equal(ours(x), published(x))


def test_narrow_networks_shrink_and_impossible_widths_are_refused():
    counts = [
        sum(weight.numel() for weight in sp_resnet.network(1, 16, 16, width).parameters())
        for width in (1 / 64, 0.125, 0.25, 0.5, 1.0)
    ]
    assert counts == sorted(counts) and counts[3] < counts[4] / 3


def table(ladders: pd.DataFrame) -> pd.DataFrame:
    """The runs of ladders as rows of the one table, beside scores and variants that are of no ladder."""
    of = ladders["family"].map(studies.FAMILIES)
    rows = ladders.assign(
        model=[each.model for each in of],
        variant=[f"{each.name}_{size:g}" for each, size in zip(of, ladders["size"], strict=True)],
        protocol=[studies.protocol(*place) for place in zip(ladders["experiment"], ladders["condition"], strict=True)],
    )
    costs = [rows.assign(condition="any", metric=cost, value=rows[cost]) for cost in ("params", "macs")]
    rows = pd.concat([rows, *(cost.drop_duplicates(["protocol", "variant", "seed"]) for cost in costs)])
    others = [rows.assign(metric="peak_error"), rows.assign(variant="lomp_half"), rows.assign(model="other")]
    others += [rows[rows["experiment"] == "touch"].assign(condition="slide")]
    others = pd.concat(others).drop_duplicates([*KEY, "seed"])
    whole = pd.concat([rows, others[~others["metric"].isin(["params", "macs"])]]).assign(budget="", n=1)
    return Results(whole[[*KEY, "seed", "budget", "unit", "value", "n"]]).table


def test_ladders_are_read_from_the_variants_of_the_one_table():
    both = pd.concat(
        [runs("lomp", "rmse", "kPa", {8: [1, 2], 32: [3, 4]}), runs("window", "rmse", "kPa", {1: [1, NAN]})]
    )
    of_strain = runs("lstm", "error", "mm", {5: [0.5]}, condition="task_1")
    of_glove = runs("sp_resnet", "macro_precision", "1", {0.25: [0.5], 1: [0.6]}, condition="strain")
    whole = table(pd.concat([both, of_strain, of_glove]))
    for experiment, wanted in {"touch": both, "strain": of_strain, "glove": of_glove}.items():
        found = studies.ladders(whole, experiment)
        key = ["family", "condition", "size", "seed"]
        pd.testing.assert_frame_equal(
            found.sort_values(key, ignore_index=True), wanted.sort_values(key, ignore_index=True), check_dtype=False
        )
    assert studies.ladders(whole[:0], "touch").empty


VARIANTS = {  # of the ladders that evidence/shards.yaml asks for
    "touch": ["hidden_8", "window_1", "lomp_half"],
    "strain": ["units_5"],
}


@pytest.mark.parametrize(
    ("experiment", "further", "words"),
    [
        ("touch", [], None),
        ("touch", ["hidden_16"], "lomp, condition single, size 16.0, seed 0"),
        ("touch", ["window_4"], "window, condition single, size 4.0, seed 0"),
        ("touch", ["width_4", "units_7"], None),  # ladders of others
        ("strain", [], None),
        ("strain", ["units_50"], "lstm, condition task_1, size 50.0, seed 0"),
    ],
)
def test_a_run_that_the_evidence_asks_for_and_that_is_missing_is_an_error(workspace, experiment, further, words):
    sets = {
        name: {"experiment": name, "data": "a", "protocols": ["press"], "seeds": 2, "minutes": 1}
        | {"variants": {one: {"models": ["x"]} for one in [*known, *(further if name == experiment else [])]}}
        for name, known in VARIANTS.items()
    }
    shards.folder(workspace).mkdir()
    (shards.folder(workspace) / "shards.yaml").write_text(json.dumps(sets))
    assert sizes_verdicts.read(
        workspace, Results(table(runs("sp_resnet", "accuracy", "1", {1: [1]}))), experiment
    ).empty
    both = [runs("lomp", "rmse", "kPa", {8: [1, 2]}), runs("window", "rmse", "kPa", {1: [1, NAN]})]
    rows = Results(table(pd.concat([*both, runs("lstm", "error", "mm", {5: [1, 2]}, condition="task_1")])))
    if words is None:
        assert len(sizes_verdicts.read(workspace, rows, experiment)) == {"touch": 4, "strain": 2}[experiment]
    else:
        with pytest.raises(InputError, match=f"no row for family {words}; run `tactile evidence` again"):
            sizes_verdicts.read(workspace, rows, experiment)


def test_every_ladder_of_the_miniature_is_climbed_and_judged(miniature):
    folder = miniature.folder
    judged = pd.read_csv(folder / "reports" / "rightsize.csv")
    sizes = {"lomp": [4, 8], "window": [1, 8], "lstm": [3, 5], "sp_resnet": [0.125, 1]}
    wanted = [("touch", c, f) for f in ("lomp", "window") for c in ("single", "double")]
    wanted += [("strain", task, "lstm") for task in ("task_1", "task_2")]
    wanted += [("glove", images, "sp_resnet") for images in ("pressure", "strain", "combined")]
    found = {key: own for key, own in judged.groupby(["experiment", "condition", "family"])}
    assert sorted(found) == sorted(wanted)
    for (_, _, family), own in found.items():
        assert list(own["size"]) == sizes[family]
        assert own["chosen"].sum() == 1 and own["value"].gt(0).all() and own["params"].is_monotonic_increasing
        assert own[["low", "high"]].isna().all(axis=None), "two seeds tell no interval"
    scores = pd.read_csv(folder / "data" / "glove" / "scores.csv")
    table = scores[(scores.protocol == "session_strain") & (scores.model == "sp_resnet")]
    full = found["glove", "strain", "sp_resnet"].iloc[1]  # trained for itself, and the same
    assert full["value"] == pytest.approx(table[table.metric == "macro_precision"]["value"].mean())
    assert full["params"] == 99_224
    assert {path.name for path in (folder / "reports" / "rightsize").iterdir()} == {
        *("README.md", "touch.png", "strain.png", "glove.png")
    }
