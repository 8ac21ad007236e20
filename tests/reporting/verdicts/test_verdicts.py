"""A verdict must follow from the numbers, whatever they are: altered scores turn it."""

import zlib
from collections.abc import Mapping
from functools import partial

import numpy as np
import pandas as pd
import pytest
from builders.project import ROOT

from pipeline.base import params, paths
from pipeline.datasets.images import MODALITIES
from pipeline.reporting import claims as claims_report
from pipeline.reporting.verdicts import glove_measures, longer, rules, strain_measures, touch_measures
from pipeline.reporting.verdicts.rules import CONTRADICTED, NOT_TESTABLE, REPRODUCED, UNDECIDED, Claim, Evidence
from pipeline.scoring import glove_results, published, results

VALUES = params.load()
for block in ("touch", "glove", "glove_recorded"):  # as many runs of each protocol and study: one has no interval
    for protocol in VALUES[block]["protocols"].values():
        protocol["seeds"] = [0, 1, 2]
for study in ("augmentation", "input_frames"):
    VALUES["glove"][study]["seeds"] = [0, 1, 2]
EXPERIMENTS = VALUES["experiments"]
CLAIMS = {one.key: one for one in claims_report.all_claims()}
JITTER = (0.01, -0.02, 0.01, 0.015, -0.015)


@pytest.fixture(autouse=True)
def _no_longer_trainings(monkeypatch):
    """The scores here are made up: how long networks of this checkout were trained says nothing of them."""
    monkeypatch.setattr(longer, "read", lambda experiment: pd.DataFrame(columns=longer.COLUMNS))


def own(k: int, *names: str) -> float:
    """A jitter of run k that no other model, protocol or condition has: two that had the same would not differ."""
    return 1e-6 * k * (zlib.crc32(" ".join(names).encode()) % 97 + 1)


class Scores:
    """Stands in for results.Scores: `level(protocol, condition, model, metric)` is the mean over the seeds."""

    def __init__(self, experiment, level):
        self.protocols, self.level = VALUES[experiment]["protocols"], level

    def runs(self, protocol, condition, model, metric):
        level = self.level(protocol, condition, model, metric)
        values = np.full(5, level) if np.ndim(level) == 0 else np.asarray(level)
        size = len(self.protocols[protocol]["seeds"])
        # The model's name moves its jitter, so that differences of two models spread too.
        turn = len(model) + len(condition)
        return [
            float(values[k] * (1 + JITTER[(k + turn) % 5] + own(k, protocol, condition, model))) for k in range(size)
        ]


def judged(key, given):
    return CLAIMS[key].judged(Evidence(VALUES, given))


def touch(**changed):
    """Errors (kPa) in which all that the paper says of LoMP is true, but for `changed`: model_condition=level."""

    def level(protocol, condition, model, metric):
        learned = model in touch_measures.LEARNED
        if metric == "touches_found":
            found = {"lomp": 0.9, "cnn": 0.5, "convlstm": 0.6, "rnn": 0.2}.get(model, 0.1)
            return changed.get(f"{model}_found", found)
        if condition == "double":
            level = {"lomp": 5.0, "linear": 17.0, "poly": 15.0, "rnn": 19.0, "vgg": 900.0}.get(model, 25.0)
        else:
            level = {"rnn": 2.0, "linear": 8.7, "constant": 11.0}.get(model, 2.3 if learned else 7.0)
        return changed.get(f"{model}_{condition}", level)

    return {("scores", "touch"): Scores("touch", level)}


@pytest.mark.parametrize(
    ("key", "changed", "reason"),
    [
        ("lomp-best-double", {"poly_double": 3.0}, "contradicted: LoMP below Polynomial"),
        ("lomp-best-double", {"rbf_double": 5.05}, "undecided: LoMP below RBF-Net"),
        ("learning-single", {"cnn_single": 9.0}, "contradicted"),
        ("rmse-single-linear", {"linear_single": 12.0}, "+39 % from the published one"),
        ("rnn-lowest", {"rnn_single": 2.6}, "contradicted"),
        ("conventional-double", {"rnn_double": 10.0}, "RNN"),
        ("vgg-overfits", {"vgg_double": 8.0}, "contradicted"),
        ("cnn-two-peaks", {"cnn_found": 0.1}, "CNN"),
        ("recognised-three", {"lomp_found": 0.3}, "is below 0.5"),
        ("growth-global", {"rnn_double": 3.0}, "RNN"),
    ],
)
def test_touch_verdicts_turn_with_the_scores(key, changed, reason):
    assert judged(key, touch()).verdict == REPRODUCED
    turned = judged(key, touch(**changed))
    assert turned.verdict == (UNDECIDED if "undecided" in reason else CONTRADICTED) and reason in turned.reason
    failed = judged(key, touch(**{next(iter(changed)): [np.nan, 1.0, 1.0, 1.0, 1.0]}))
    assert failed.verdict == NOT_TESTABLE and failed.reason.startswith("failed runs: ") and "1 of 3" in failed.reason
    assert np.isnan(failed.ours)


def strain(**changed):
    def level(protocol, condition, model, metric):
        levels = {"lstm_direct": 0.43, "lstm_transfer": 0.66, "esn": 0.5, "ridge": 0.9}
        if protocol == "task_2":
            levels = {"lstm_direct": 27.0, "lstm_transfer": 26.0, "esn": 24.0, "ridge": 33.0}
        if metric == "r2":
            return {"task_1": 0.95, "task_2": 0.4, "task_0": 0.2}[protocol]
        return changed.get(f"{model}_{protocol}", levels[model])

    return {("scores", "strain"): Scores("strain", level)}


@pytest.mark.parametrize(
    ("key", "changed"),
    [
        ("direct-better-task_1", {"lstm_transfer_task_1": 0.3}),
        ("error-lstm_direct-task_2", {"lstm_direct_task_2": 18.0}),
        ("accuracy-ratio-task_1", {"lstm_transfer_task_1": 1.2}),
        ("transfer-better-task_2", {"lstm_transfer_task_2": 40.0}),
        ("gap-shrinks", {"lstm_transfer_task_2": 60.0}),
        ("states-carry-task_2", {"ridge_task_2": 20.0}),
        ("reservoir-task_1", {"esn_task_1": 2.0}),
    ],
)
def test_strain_verdicts_turn_with_the_scores(key, changed):
    assert judged(key, strain()).verdict == REPRODUCED
    assert judged(key, strain(**changed)).verdict == CONTRADICTED
    assert judged(key, strain(**{name: [np.nan] * 5 for name in changed})).verdict == NOT_TESTABLE


def drift(level):
    rows = [
        ("task_1", source, "true drift", seed, value + 0.01 * seed + own(seed, source))
        for source, value in (("raw voltages, 10 samples", 0.8), ("latent of model-0", level))
        for seed in (0, 1, 2)
    ]
    return strain() | {("study", "drift"): pd.DataFrame(rows, columns=["protocol", "input", "target", "seed", "value"])}


def test_drift_is_judged_by_the_decoder():
    free, less = "drift-free-true-drift-task_1", "drift-less-true-drift-task_1"
    assert [judged(key, drift(0.02)).verdict for key in (free, less)] == [REPRODUCED] * 2
    assert [judged(key, drift(0.5)).verdict for key in (free, less)] == [CONTRADICTED, REPRODUCED]
    assert [judged(key, drift(0.9)).verdict for key in (free, less)] == [CONTRADICTED] * 2
    assert judged(free, drift(np.nan)).verdict == NOT_TESTABLE


def samples(transfer):
    rows = [
        ("task_1", model, n, seed, (level if n < 5000 else 0.5) + 0.01 * seed + own(seed, model, str(n)))
        for model, level in (("lstm_direct", 2.0), ("lstm_transfer", transfer))
        for n in (100, 1000, 24000)
        for seed in (0, 1, 2)
    ]
    frame = pd.DataFrame(rows, columns=["protocol", "model", "samples", "seed", "value"])
    return strain() | {("study", "samples"): frame}


def test_few_samples_are_judged_by_the_study():
    for key in ("few-samples-task_1", "samples-needed-task_1"):
        assert judged(key, samples(1.0)).verdict == REPRODUCED
        assert judged(key, samples(3.0)).verdict == CONTRADICTED
        assert judged(key, samples(np.nan)).verdict == NOT_TESTABLE


def test_training_times_and_parameters():
    for ours, verdict in ((11450, REPRODUCED), (11451, CONTRADICTED)):
        fits = [results.Fit("completed", 1, 1, ours, pd.DataFrame())]
        key = "parameters-lstm_direct-task_1"
        assert judged(key, strain() | {("fits", "strain", "lstm_direct", "task_1"): fits}).verdict == verdict
    ratio = published.latent("lstm_direct", "task_1", "training time") / published.latent(
        "lstm_transfer", "task_1", "training time"
    )
    for factor, verdicts in ((ratio, [REPRODUCED] * 2), (0.5, [CONTRADICTED] * 2)):
        given = strain()
        for model, times in (("lstm_direct", factor), ("lstm_transfer", 1.0)):
            taken = [times, 1.01 * times, (0.99 + own(1, model)) * times]
            given["training_times", "strain", model, "task_1"] = taken
        keys = ("time-ratio-task_1", "time-less-task_1")
        assert [judged(key, given).verdict for key in keys] == verdicts


def glove(experiment="glove", **changed):
    levels = {"resnet18": 0.96, "sp_resnet": 0.93, "mobilenet": 0.88, "resnet3x3": 0.87, "sp_resnet_nogcam": 0.86}
    levels |= {"tree": 0.7, "naive_bayes": 0.6, "constant": 0.06}

    def level(protocol, condition, model, metric):
        less = {"combined": 1.0, "pressure": 0.9, "strain": 0.8}[condition]
        return changed.get(f"{model}_{condition}", levels[model] * less)

    scores = Scores(experiment, level)
    small = [value / 100 for value in JITTER]
    scores.runs = lambda *key: [
        level(*key) + small[k] + own(k, *key[:3]) for k in range(len(scores.protocols[key[0]]["seeds"]))
    ]
    if "spread" in changed:  # of SP-ResNet alone, so that it does not cancel in a difference
        wide = [0.0, changed["spread"], -changed["spread"]]
        scores.runs = lambda *key: [
            level(*key) + (wide[k] if key[2] == "sp_resnet" else own(k, *key[:3])) for k in range(3)
        ]
    return {("scores", experiment): scores}


@pytest.mark.parametrize(
    ("key", "changed", "word"),
    [
        ("fusion", {"sp_resnet_combined": 0.6}, "is below 0"),
        ("fusion-networks", {"mobilenet_combined": 0.6}, "contradicted: MobileNet"),
        ("precision-combined-sp_resnet", {"sp_resnet_combined": 0.8}, "% from the published one"),
        ("second-best", {"mobilenet_combined": 0.95}, "above it by their means: ResNet-18, MobileNet"),
        ("second-best", {"spread": 0.2}, "above it by their means: ResNet-18"),
        ("attention-combined", {"sp_resnet_combined": 0.8}, "is below 0"),
        ("attention-combined", {"spread": 0.2}, "includes 0"),
        ("networks-above-baselines-combined", {"tree_combined": 0.9}, "contradicted"),
        ("order-combined", {"tree_combined": 0.99}, "of 21 pairs"),
    ],
)
def test_glove_verdicts_turn_with_the_scores(key, changed, word):
    true = {"mobilenet_combined": 0.90} | ({"mobilenet_combined": 0.91} if key == "order-combined" else {})
    true |= {"sp_resnet_nogcam_combined": 0.89, "resnet3x3_combined": 0.88}
    if key.startswith("precision"):  # to a share of the errors, of which there are few
        true |= {"sp_resnet_combined": 0.955}
    assert judged(key, glove(**true)).verdict == REPRODUCED
    turned = judged(key, glove(**true | changed))
    assert turned.verdict == (UNDECIDED if "spread" in changed or key.startswith("order") else CONTRADICTED)
    assert word in turned.reason
    failed = judged(key, glove(**true | {"sp_resnet_combined": np.nan}))
    assert failed.verdict == NOT_TESTABLE and "SP-ResNet" in failed.reason


def test_fusion_is_the_gain_of_the_report():
    given = glove()
    ours = glove_measures.fusion(Evidence(VALUES, given), "sp_resnet")
    pair = (("session_combined", "sp_resnet"), ("session_pressure", "sp_resnet"))
    theirs = glove_results.gain(given["scores", "glove"], *pair)
    assert results.estimate(ours) == pytest.approx(theirs)


def test_augmentation_helps_or_not():
    values = {(m, d): [0.80, 0.81, 0.82] for m in published.METHODS for d in ("pressure", "strain", "combined")}
    for gain, helps, useless in ((0.05, REPRODUCED, CONTRADICTED), (-0.05, CONTRADICTED, REPRODUCED)):
        values["A", "strain"] = values["B", "strain"] = [value + gain for value in values["none", "strain"]]
        values["A", "strain"][0] += 0.001  # some spread
        given = glove() | {("augmentation",): values}
        assert judged("augmentation-A-strain", given).verdict == helps
        assert judged("augmentation-B-strain", given).verdict == useless
    values["A", "strain"] = [np.nan, 0.8, 0.8]
    assert judged("augmentation-A-strain", glove() | {("augmentation",): values}).verdict == NOT_TESTABLE


def test_counts_are_exact_at_the_printed_precision():
    counts = pd.read_csv(ROOT / "reports" / "counts.csv")
    assert judged("macs-resnet18", {("counts",): counts}).verdict == REPRODUCED
    counts.loc[counts["model"] == "resnet18", "macs"] += 1_000_000
    assert judged("macs-resnet18", {("counts",): counts}).verdict == CONTRADICTED
    for column in ("macs", "params"):
        small = counts["published_macs"].isna() & (counts["model"] == "sp_resnet")
        for value, verdict in ((1, REPRODUCED), (10**12, CONTRADICTED)):
            counts.loc[small, column] = value
            assert judged(f"fewest-{column}", {("counts",): counts}).verdict == verdict
    assert judged("macs-resnet18", {("counts",): counts.iloc[:0]}).verdict == NOT_TESTABLE


def test_named_pairs_are_judged_by_the_confusions():
    objects = ["empty_bottle", "full_bottle_1", "full_bottle_2", "paper_roll", "toy"]
    apart = np.stack([np.diag([10 + k] * 5) for k in range(3)])
    mixed = apart.copy()
    for k in range(3):
        mixed[k, 3, 4] = mixed[k, 4, 3] = 6 + k
    # Never confused in any run: three times 0 tell nothing of the spread.
    for pressure, verdict in ((mixed, REPRODUCED), (apart, NOT_TESTABLE)):
        found = {"pressure": pressure, "strain": apart, "combined": apart}
        given = glove() | {("confusions",): (found, objects)}
        assert judged("confused-pressure-paper_roll-toy", given).verdict == verdict
        assert judged("resolved-pressure-paper_roll-toy", given).verdict == verdict
    given = glove() | {("confusions",): (found, objects[:3])}
    assert judged("confused-pressure-paper_roll-toy", given).reason == "there is no object paper_roll, toy"


def test_number_of_frames():
    def frames(last, form="trained"):
        rows = [
            (form, model, seed, n, "macro_precision", level + 0.01 * n * seed + own(seed, model, str(n)))
            for model, levels in (("sp_resnet", (0.6, last)), ("resnet3x3", (0.5, 0.5)))
            for n, level in enumerate(levels, start=1)
            for seed in (0, 1, 2)
        ]
        return pd.DataFrame(rows, columns=["form", "model", "seed", "frames", "metric", "value"])

    above, more = "above-resnet3x3-stag", "more-frames-sp_resnet-stag"
    for last, verdicts in ((0.8, [REPRODUCED] * 2), (0.3, [CONTRADICTED] * 2)):
        given = glove() | {("stag",): frames(last)}
        assert [judged(key, given).verdict for key in (above, more)] == verdicts
        alone = glove() | {("stag",): frames(last, "mean")}
        assert [judged(key, alone).verdict for key in (above, more)] == verdicts
        assert "mean prediction of a one-frame network" in judged(more, alone).reason
        # Where networks were trained on several frames, the mean prediction decides nothing.
        both = pd.concat([frames(last), frames(1.1 - last, "mean")])
        assert [judged(key, glove() | {("stag",): both}).verdict for key in (above, more)] == verdicts
        assert "one network trained on all frames" in judged(more, given).reason
    single = frames(0.8).query("seed == 0")
    assert judged(more, glove() | {("stag",): single}).reason == "one run has no interval"
    absent = judged(above, glove() | {("stag",): frames(0.8).iloc[:0]})
    assert absent.verdict == NOT_TESTABLE and "STAG" in absent.reason


def test_latency_claims_are_ratios_and_marked():
    def latency(**times):
        batch = VALUES["touch"]["latency"]["batches"][0]
        return touch() | {("latency", "touch"): {(model, batch): {"p50_ms": t} for model, t in times.items()}}

    assert judged("latency-order", latency(linear=0.96, cnn=1.33, lomp=1.6, rnn=1.9)).verdict == REPRODUCED
    close = judged("latency-order", latency(linear=0.96, cnn=1.33, lomp=1.34, rnn=1.9))
    assert close.verdict == UNDECIDED and "too close: LoMP above CNN" in close.reason
    turned = judged("latency-order", latency(linear=2.0, cnn=1.0, lomp=1.6, rnn=1.9))
    assert turned.verdict == CONTRADICTED and "not: CNN above linear" in turned.reason
    assert judged("latency-lomp-cnn", latency(cnn=10.0, lomp=10.9)).verdict == REPRODUCED
    marked = {one.key for one in CLAIMS.values() if one.measured}
    named = ("latency", "time-ratio", "time-less", "time-absolute")
    assert marked == {key for key in CLAIMS if key.startswith(named)}


def test_own_logs_are_recorded_data():
    one = CLAIMS["lomp-best-double"]
    assert claims_report.on_own_logs(one, VALUES) is one
    own = claims_report.on_own_logs(one, VALUES | {"touch": VALUES["touch"] | {"source": "data/own/mine"}})
    assert (own.data, own.why, own.judge) == ("recorded", None, one.judge)


def test_rules():
    series = pd.Series
    assert rules.positive(series([1.0, 1.1, 0.9])).verdict == REPRODUCED
    unsure = rules.positive(series([1.0, -1.1, 0.9]))
    assert (unsure.verdict, unsure.reason) == (UNDECIDED, "the interval includes 0")
    assert rules.positive(series([-1.0, -1.1, -0.9])).verdict == CONTRADICTED
    assert [rules.positive(series([1.0, 1.1]), above=limit).verdict for limit in (0.3, 1.05, 2.0)] == [
        REPRODUCED, UNDECIDED, CONTRADICTED,
    ]  # fmt: skip
    with pytest.raises(rules.NotTestable, match="one run has no interval"):
        rules.positive(series([1.0]))
    # Paired by seed: what has no partner does not count.
    one, other = series([1.0, 2.0, 3.0], index=[0, 1, 2]), series([9.0, 0.0, 1.1], index=[7, 1, 2])
    assert rules.positive(one - other).ours == pytest.approx(1.95)
    assert rules.within(series([0.01, -0.01, 0.0]), 0.1).verdict == REPRODUCED
    assert rules.within(series([1.01, 0.99, 1.0]), 0.1, around=1.0).verdict == REPRODUCED
    assert rules.within(series([0.5, 0.51, 0.49]), 0.1).verdict == CONTRADICTED
    assert rules.within(series([0.5, -0.5, 0.0]), 0.1).verdict == UNDECIDED
    assert rules.at_most(series([-5.0, -5.1]), 0.1).verdict == REPRODUCED
    assert rules.at_most(series([0.5, 0.51, 0.49]), 0.1).verdict == CONTRADICTED
    largest = rules.all_at_most({"a": series([1.0, 1.1]), "b": series([1.2, 1.3])}, 2.0)
    assert (largest.verdict, largest.ours) == (REPRODUCED, pytest.approx(1.25))
    assert largest.low < 1.2 and 1.3 < largest.high < 2
    many = rules.all_positive({str(k): series([-1.0, -1.1]) for k in range(5)} | {"good": series([1.0, 1.1])})
    assert many.verdict == CONTRADICTED and many.reason == "1 of 6 hold; contradicted: 0, 1, 2 and 2 more"
    unsure = rules.all_positive({"wide": series([-1.0, 2.0]), "good": series([1.0, 1.1])})
    assert unsure.verdict == UNDECIDED and unsure.reason == "1 of 2 hold; undecided: wide"


@pytest.mark.parametrize(
    ("values", "best", "verdict"),
    [
        ([9.6, 10.0, 10.2], 0.0, REPRODUCED),
        ([5.0, 15.0, 16.0], 0.0, UNDECIDED),  # a wide interval is no reproduction, and no contradiction
        ([8.0, 8.0, 8.1], 0.0, CONTRADICTED),
        ([10.0, 10.05, 10.1], 11.6, REPRODUCED),
        ([9.6, 9.61, 9.62], 11.0, CONTRADICTED),  # 4 % off, but with 1.4 times the error
    ],
)
def test_a_number_is_held_against_a_band_on_the_scale_of_errors(values, best, verdict):
    judged_number = rules.number(pd.Series(values), 10.0, best=best)
    assert judged_number.verdict == verdict and "the band is 15 %" in judged_number.reason


def test_an_order_is_a_share_of_pairs():
    right, wrong = pd.Series([1.0, 1.1, 0.9]), pd.Series([-1.0, -1.1, -0.9])
    mixed = pd.Series([1.0, 1.0, -1.0])
    orders = {"all": [right] * 21, "four": [right] * 4 + [mixed], "few": [right] * 2 + [mixed] + [wrong] * 27}
    found = {name: rules.ordered({str(k): gap for k, gap in enumerate(gaps)}) for name, gaps in orders.items()}
    assert [found[name].verdict for name in orders] == [REPRODUCED, UNDECIDED, CONTRADICTED]
    assert found["few"].ours == pytest.approx(2.67 / 30, abs=1e-3)
    assert found["few"].reason.startswith("3 of 30 pairs are in the paper's order by their means, 2 for certain")


def test_a_difference_is_compatible_where_the_interval_includes_the_printed_one():
    values = pd.Series([1.0, 1.1, 0.9])
    for printed, compatible in ((1.05, True), (3.0, False), (np.nan, None)):
        one = Claim("lomp", "a", "I", "kPa", "A.", lambda e: rules.positive(values), printed)
        assert one.judged(Evidence(VALUES)).compatible is compatible
    number = Claim("lomp", "a", "I", "kPa", "A.", lambda e: rules.positive(values), 1.05, kind=rules.NUMBER)
    assert number.judged(Evidence(VALUES)).compatible is None


def test_a_printed_number_is_judged_on_the_papers_split_and_beside_it_on_the_stricter_one():
    for easy, hard, verdicts in ((8.7, 12.0, (REPRODUCED, CONTRADICTED)), (6.0, 8.7, (CONTRADICTED, REPRODUCED))):
        level = {"random_window": easy, "press": hard}
        given = {("scores", "touch"): Scores("touch", lambda protocol, *_, level=level: level[protocol])}
        found = judged("rmse-single-linear", given)
        assert (found.verdict, found.strict) == verdicts
    level = {"random_window": np.nan, "press": 8.7}
    given = {("scores", "touch"): Scores("touch", lambda protocol, *_: level[protocol])}
    assert judged("rmse-single-linear", given)[3] == NOT_TESTABLE and judged("rmse-single-linear", given).strict


def test_what_a_scene_was_tuned_to_is_no_result():
    keys = [key for key in CLAIMS if CLAIMS[key].kind == rules.CALIBRATION]
    claims = [one for one in claims_report.all_claims() if one.kind == rules.CALIBRATION]
    assert {one.paper for one in claims} == set(rules.PAPERS) and keys
    for one in claims:
        chosen = VALUES[rules.EXPERIMENTS[one.paper]]["yardstick"]
        assert one.published == pytest.approx(chosen["published"], abs=5e-4)
        experiment = rules.EXPERIMENTS[one.paper]
        given = {("scores", experiment): Scores(experiment, lambda *key: 0.5)}
        assert one.judged(Evidence(VALUES, given)).verdict == rules.CALIBRATED


def test_absent_recordings_and_missing_runs_are_not_testable(tmp_path, monkeypatch):
    monkeypatch.setattr(paths, "ROOT", tmp_path)
    path = paths.ingest_report("glove_recorded")
    path.parent.mkdir(parents=True)
    path.write_text('{"run": false, "reason": "recordings not downloaded"}')
    found = CLAIMS["fusion-recorded"].judged(Evidence(VALUES))
    assert found.verdict == NOT_TESTABLE and found.reason == "recordings not downloaded"
    settings = VALUES | {"touch": VALUES["touch"] | {"models": {"linear": {}}}}
    found = CLAIMS["lomp-best-double"].judged(Evidence(settings, touch()))
    assert found.verdict == NOT_TESTABLE and "is not among the models" in found.reason
    # A row that the file does not have: the sentence of results.Scores.
    paths.scores("touch").parent.mkdir(parents=True)
    header = "experiment,protocol,condition,model,seed,metric,unit,value,n\n"
    paths.scores("touch").write_text(header + "touch,press,single,linear,0,rmse,kPa,8.7,1\n")
    given = {("absent", "touch"): None}
    found = CLAIMS["rmse-single-linear"].judged(Evidence(VALUES, given))
    assert (
        found.verdict == NOT_TESTABLE
        and "no row for protocol random_window" in found.reason
        and "seed 0" in found.reason
    )


class Unread(Exception):
    """A claim rests on something else than scores."""


class OnlyScores(Evidence):
    """Evidence that has what it is given and reads no file."""

    def once(self, key, read):
        if key not in self._known:
            raise Unread(key)
        return self._known[key]


def test_no_claim_on_scores_survives_failed_runs():
    given = {("scores", name): Scores(name, lambda *key: np.nan) for name in EXPERIMENTS}
    verdicts = []
    for one in CLAIMS.values():
        try:
            verdicts.append((one.judged(OnlyScores(VALUES, given)).verdict, one.key))
        except Unread:
            continue
    assert len(verdicts) > 100
    assert {verdict for verdict, _ in verdicts} == {NOT_TESTABLE}, [v for v in verdicts if v[0] != NOT_TESTABLE]


def test_the_list_of_claims():
    found = claims_report.all_claims()
    assert len(found) >= 36 and len(CLAIMS) == len(found)
    assert {one.paper for one in found} == set(rules.PAPERS)
    for paper in rules.PAPERS:
        assert {one.data for one in found if one.paper == paper} == {"simulated", "recorded"}
    sentences = [(one.text, one.data) for one in found]
    assert len(set(sentences)) == len(sentences)
    for one in found:
        assert one.text.endswith(".") and one.section and one.unit
        assert one.kind == rules.SENTENCE or np.isfinite(one.published) or one.kind == rules.CONSTRUCTION, one.key
    kept = pd.read_csv(ROOT / "reports" / "claims.csv")
    assert list(kept["id"]) == [one.id for one in found] and kept["id"].is_unique
    assert list(kept["claim"]) == [one.text for one in found]
    assert kept["published"].to_numpy() == pytest.approx([one.published for one in found], rel=1e-9, nan_ok=True)
    assert set(kept["verdict"]) <= {*rules.VERDICTS, rules.CALIBRATED}
    assert not kept.loc[kept["verdict"] == REPRODUCED, "ours"].isna().any()
    assert (kept.loc[kept["verdict"] != REPRODUCED, "reason"].fillna("") != "").all()


def test_a_paragraph_is_printed_only_where_a_claim_is_not_reproduced():
    def claim(key, judge, why):
        return Claim("lomp", key, "I", "kPa", f"Sentence {key}.", judge, 1.0, why=why)

    good, bad = pd.Series([1.0, 1.1, 0.9]), pd.Series([-1.0, -1.1, -0.9])
    listed = [
        claim("good", lambda e: rules.positive(good), lambda e: "Never printed."),
        claim("bad", lambda e: rules.positive(bad), lambda e: f"Computed: {bad.mean():.1f}."),
        claim("worse", lambda e: rules.positive(bad), lambda e: f"Computed: {bad.mean():.1f}."),
        claim("bare", lambda e: rules.positive(bad), None),
        claim("gone", rules.untestable("nobody knows"), lambda e: "Never printed."),
    ]
    evidence = Evidence(VALUES)
    found = [(one, one.judged(evidence)) for one in listed]
    rows = claims_report.rows(found, VALUES)
    by_id = {one.id: one for one in listed}
    shown = claims_report.by_scale(rows, rows.iloc[:0])
    text = claims_report.text(shown, lambda name: by_id[name].explained(evidence))
    assert "Never printed" not in text and text.count("Computed: -1.0.") == 1
    told = "(contradicted; the interval is below 0)"
    assert f"**Sentence bad** {told}\n- **Sentence worse** {told}\n\nComputed" in text
    assert "No reason was looked for" in text and "nobody knows" in text
    assert list(rows.columns)[:15] == [
        "id", "claim", "paper", "section", "data", "kind", "published", "ours", "low", "high", "unit", "verdict",
        "strict", "strict_ours", "compatible",
    ]  # fmt: skip
    assert list(rows["verdict"]) == [REPRODUCED, *[CONTRADICTED] * 3, NOT_TESTABLE]
    counted = [one for one in text.splitlines() if one.startswith("| simulated")]
    cells = [cell.strip() for cell in counted[0].strip("|").split("|")]
    assert cells == ["simulated", "LoMP (touch)", "sentence", "1", "3", "0", "1", "5"]


def steady(experiment, level):
    """Scores of `level(protocol, condition, model, metric)` whose seeds agree: the mean alone decides."""
    scores = Scores(experiment, level)
    scores.runs = lambda *key: [
        level(*key) * (1 + own(k, *key[:3])) for k in range(len(scores.protocols[key[0]]["seeds"]))
    ]
    return {("scores", experiment): scores}


def above(experiment, higher, share, protocols=""):
    """All scores are 1; those of the model `higher`, on protocols that start like `protocols`, are 1 + share."""
    return steady(
        experiment, lambda protocol, _, model, __: 1 + share * (model == higher) * protocol.startswith(protocols)
    )


def grown(share):
    """Errors that grow from single to double touch by 1 + share times what the paper's do."""
    factor = (1 + share) * CLAIMS["growth-lomp"].published
    return steady("touch", lambda protocol, condition, *_: factor if condition == "double" else 1.0)


def times(less):
    """A prediction of the RNN takes 1.2 - less times as long as one of LoMP."""
    batch = VALUES["touch"]["latency"]["batches"][0]
    rows = {("lomp", batch): {"p50_ms": 1.0}, ("rnn", batch): {"p50_ms": 1.2 - less}}
    return touch() | {("latency", "touch"): rows}


def read_off(task, target, r2):
    """`target` is read from the latent space with this R2."""
    rows = [(task, strain_measures.LATENT, target, seed, r2 + 1e-6 * seed) for seed in (0, 1, 2)]
    return strain() | {("study", "drift"): pd.DataFrame(rows, columns=["protocol", "input", "target", "seed", "value"])}


def noise_gain(points):
    """Noise alone gains so many points on every dataset."""
    gained = {
        (method, dataset): 0.8 + points / 100 * (method == "B") for method in ("none", "B") for dataset in MODALITIES
    }
    return glove() | {
        ("augmentation",): {key: [value + own(k, *key) / 10 for k in range(3)] for key, value in gained.items()}
    }


OF_TABLE = "our error is within 15 % of the printed one"
OF_TIME = "the ratio of medians is more than 10 % on the claimed side of 1"
# Claim; words of the committed report that name its margin; the margin; evidence in which the number that it limits
# has a given value.
MARGINS = [
    ("lomp-like-rnn", "margin 0.1 around 1.", 0.1, lambda share: above("touch", "lomp", share)),
    ("lomp-like-rnn", "margin 0.1 around 1.", 0.1, lambda share: above("touch", "lomp", -share)),
    ("locations", "limit 1.5;", 1.5, lambda mm: steady("touch", lambda *_: mm)),
    ("recognised-three", "more than half", 0.5, lambda rest: steady("touch", lambda *_: 1 - rest)),
    ("recognised-slide", "more than half", 0.5, lambda rest: steady("touch", lambda *_: 1 - rest)),
    ("recognised-tape", "more than half", 0.5, lambda rest: steady("touch", lambda *_: 1 - rest)),
    ("growth-lomp", OF_TABLE, 0.15, grown),
    ("growth-lomp", OF_TABLE, 0.15, lambda share: grown(-share)),
    ("latency-lomp-rnn", OF_TIME, 0.1, times),
    ("transfer-better-task_2", "at most 10 % above", 0.1, lambda share: above("strain", "lstm_transfer", share)),
    ("reservoir-task_1", "(10 %)", 0.1, lambda share: above("strain", "esn", share)),
    ("reservoir-task_2", "(10 %)", 0.1, lambda share: above("strain", "esn", share)),
    ("transfer-recorded", "at most 10 % above", 0.1, lambda share: above("strain_recorded", "lstm_transfer", share)),
    ("reservoir-recorded", "(10 %)", 0.1, lambda share: above("strain_recorded", "esn", share)),
    ("drift-free-recorded", "(10 %)", 0.1, lambda share: above("strain_recorded", "lstm_transfer", share, "across_")),
    ("lstm-drift-recorded", "(10 %)", 0.1, lambda share: above("strain_recorded", "lstm_direct", share, "across_")),
    *(
        (f"drift-free-{target.replace(' ', '-')}-{task}", "(R2 below 0.1)", 0.1, partial(read_off, task, target))
        for task in strain_measures.TASKS
        for target in ("true drift", "elapsed time")
    ),
    *((f"augmentation-B-{dataset}", "(a gain below 0.5 points)", 0.5, noise_gain) for dataset in MODALITIES),
]


@pytest.mark.parametrize(("key", "words", "margin", "given"), MARGINS, ids=[key for key, *_ in MARGINS])
def test_a_margin_is_the_one_that_is_printed(key, words, margin, given):
    rows = pd.read_csv(ROOT / "reports" / "claims.csv", keep_default_na=False).set_index("id")
    name = CLAIMS[key].id
    rules = (ROOT / "reports" / "claims.md").read_text().split("## Counts")[0]
    printed = rules if words in (OF_TABLE, OF_TIME) else f"{rows.claim[name]} {rows.reason[name]}."
    assert words in printed
    below, beyond = (judged(key, given(factor * margin)).verdict for factor in (0.98, 1.02))
    assert (below, beyond) == (REPRODUCED, UNDECIDED if words == OF_TIME else CONTRADICTED)


@pytest.mark.parametrize(("size", "counts"), [(1000, True), (1001, False)])
def test_few_samples_are_at_most_the_tenth_that_the_sentence_names(size, counts):
    assert "(up to a tenth)" in CLAIMS["few-samples-task_1"].text
    frame = pd.DataFrame({"samples": [size, 10_000]})
    evidence = Evidence(VALUES, strain() | {("study", "samples"): frame})
    if counts:
        assert strain_measures.few(evidence) == [size]
    else:
        with pytest.raises(rules.NotTestable, match="no training set of a tenth"):
            strain_measures.few(evidence)


@pytest.mark.parametrize(("rank", "verdict"), [(3, REPRODUCED), (4, CONTRADICTED)])
def test_confused_objects_are_among_the_worst_three_that_the_sentence_names(rank, verdict):
    key = "confused-pressure-paper_roll-toy"
    assert CLAIMS[key].text.endswith("among the worst three.")
    objects = ["a", "b", "c", "d", "paper_roll", "toy"]
    counts = np.stack([np.diag([100 + k] * 6) for k in range(3)])
    counts[:, 4, 5] = 10
    for first in range(rank - 1):
        counts[:, first, first + 1] = 20
    found = {dataset: counts for dataset in MODALITIES}
    assert judged(key, glove() | {("confusions",): (found, objects)}).verdict == verdict


def test_pressure_is_high_above_200_kpa_on_single_touches_of_the_test_part(monkeypatch):
    import pyarrow as pa

    from pipeline.datasets import labels, schemas

    settings, (protocol, *_) = VALUES["touch"], VALUES["touch"]["protocols"]
    seeds, radius = settings["protocols"][protocol]["seeds"], settings["label"]["tip_radius_mm"]
    kpa = np.array([199.0, 201.0, 300.0, 300.0, 300.0, 300.0])
    condition = ["single"] * 5 + ["double"]
    part = ["test", "test", "test", "train", "validation", "test"]
    force = (kpa / labels.pressure_kpa(np.ones(1), radius))[:, None].astype(np.float32)
    columns = {"condition": condition, **{schemas.split_column(protocol, seed): part for seed in seeds}}
    table = pa.table({name: pa.array(column).dictionary_encode() for name, column in columns.items()})
    table = table.append_column("force_n", schemas.lists(force, pa.float32()))
    off = np.array([1000.0, 20.0, 40.0, 1000.0, 1000.0, 1000.0])  # of the rows that count 30 on average
    cells = settings["label"]["map_rows"] * settings["label"]["map_cols"]
    maps = np.zeros((len(kpa), cells), np.float32)
    maps[:, 7] = kpa - off * [1, 1, -1, 1, 1, 1]
    monkeypatch.setattr(touch_measures, "read_predictions", lambda *run: maps)
    evidence = Evidence(VALUES, touch() | {("table", "touch"): table})
    found = touch_measures.high_pressure_error(evidence, "rnn")
    assert list(found.index) == seeds and found.to_numpy() == pytest.approx(30.0, abs=1e-3)
    assert "Error of the peak above 200 kPa (kPa): CNN 30.0" in touch_measures.why_high(evidence)


def test_press_off_the_centre_shifts_the_curve(tmp_path, monkeypatch):
    import pyarrow as pa
    import pyarrow.parquet

    from pipeline.datasets import schemas

    monkeypatch.setattr(paths, "ROOT", tmp_path)
    rng, n = np.random.default_rng(0), 4000
    x, y = rng.uniform(0, 60, n), rng.uniform(0, 60, n)
    away = np.maximum(np.abs(x % 12 - 6), np.abs(y % 12 - 6))
    element = (y // 12).astype(int) * 5 + (x // 12).astype(int)
    for loss, verdict in ((100, REPRODUCED), (0, UNDECIDED), (-100, CONTRADICTED)):
        counts = np.zeros((n, 25), dtype=np.int16)
        counts[np.arange(n), element] = 500 - loss * (away > 3) + rng.normal(0, 20, n)
        force = rng.uniform(5, 25, n)
        touches = [np.column_stack([column, np.full(n, np.nan)]).astype(np.float32) for column in (force, x, y)]
        columns = dict(zip(("force_n", "x_mm", "y_mm"), touches, strict=True))
        table = pa.table(
            {"condition": pa.array(["single"] * n).dictionary_encode(), "v": schemas.lists(counts, pa.int16())}
            | {name: schemas.lists(column, pa.float32()) for name, column in columns.items()}
        )
        paths.frames("touch").parent.mkdir(parents=True, exist_ok=True)
        pyarrow.parquet.write_table(table, paths.frames("touch"))
        assert judged("off-centre", touch()).verdict == verdict


def test_strands_are_redundant_where_they_move_together():
    import pyarrow as pa

    from pipeline.datasets import schemas

    rng, n = np.random.default_rng(0), 2000
    together = np.repeat(rng.normal(0, 1, (n, 1)), 3, axis=1) + rng.normal(0, 0.1, (n, 3))
    for first, second, verdict in (
        (together, rng.normal(0, 1, (n, 3)), REPRODUCED),
        (rng.normal(0, 1, (n, 3)), together, CONTRADICTED),
    ):
        names = pa.array(["task_1"] * n + ["task_2"] * n).dictionary_encode()
        fingers = pa.array([f"run00{k % 4}" for k in range(2 * n)]).dictionary_encode()
        voltage = np.concatenate([first, second]).astype(np.float32)
        table = pa.table({"condition": names, "recording": fingers, "v": schemas.lists(voltage, pa.float32())})
        judgement = judged("redundant-strands", strain() | {("table", "strain"): table})
        assert judgement.verdict == verdict and judgement.over == "4 recordings"


def bases(task_1, task_0):
    """bases.csv with these errors of transfer to task 2, of three seeds."""
    rows = [
        ("task_2", base, "lstm_transfer", seed, error + 0.1 * seed + own(seed, base))
        for base, error in (("task_1", task_1), ("task_0", task_0))
        for seed in range(3)
    ]
    return pd.DataFrame(rows, columns=["protocol", "base", "model", "seed", "value"])


def strands(fewest, most, task_2=None):
    """strands.csv with these errors of transfer with 2 and with 6 strands, those of direct training being 1."""
    rows = []
    for task, (few, many) in {"task_1": (fewest, most), "task_2": task_2 or (fewest, most)}.items():
        for count, error in ((2, few), (6, many)):
            for seed in range(3):
                rows.append((task, count, "lstm_transfer", seed, error + 0.01 * seed + own(seed, str(count))))
                rows.append((task, count, "lstm_direct", seed, 1.0))
    return pd.DataFrame(rows, columns=["protocol", "strands", "model", "seed", "value"])


def test_a_network_of_task_1_is_unfit_where_transfer_from_it_is_worse():
    for task_1, task_0, verdict in ((30.0, 26.0, REPRODUCED), (26.0, 30.0, CONTRADICTED)):
        given = strain() | {("study", "bases"): bases(task_1, task_0)}
        assert judged("base-task_1", given).verdict == verdict
        assert CLAIMS["base-task_1"].why(Evidence(VALUES, given))
    assert judged("base-task_1", strain() | {("study", "bases"): bases(np.nan, 1.0)}).verdict == NOT_TESTABLE


def test_more_strands_help_transfer_where_its_excess_falls_on_both_tasks():
    for table, verdict in (
        (strands(2.0, 1.5), REPRODUCED),
        (strands(1.5, 2.0), CONTRADICTED),
        (strands(2.0, 1.5, task_2=(1.5, 2.0)), CONTRADICTED),
        (strands(2.0, 1.5).query("strands == 2"), NOT_TESTABLE),
    ):
        assert judged("more-strands", strain() | {("study", "strands"): table}).verdict == verdict
    assert CLAIMS["more-strands"].why(Evidence(VALUES, strain() | {("study", "strands"): strands(2.0, 1.5)}))


@pytest.mark.parametrize(
    ("epochs", "protocol", "longer_error", "verdict"),
    [(16, "press", 0.98, NOT_TESTABLE), (16, "random_window", 0.98, NOT_TESTABLE), (16, "press", 0.995, REPRODUCED),
     (16, "press", 1.05, REPRODUCED), (8, "press", 0.5, REPRODUCED)],
)  # fmt: skip
def test_a_claim_on_a_network_that_still_improves_has_no_verdict(monkeypatch, epochs, protocol, longer_error, verdict):
    """Trained for other epochs than params.yaml says, or no better for longer, says nothing; another split does."""
    monkeypatch.setattr(rules.params, "scale_of", lambda experiment, settings: "laptop")
    trainings = pd.DataFrame([(protocol, "cnn", 0, epochs, 1.0, 32, longer_error, 9.0)], columns=longer.COLUMNS)
    values = {"touch": {"models": {"cnn": {"training": {"epochs": 16}}}, "protocols": {"press": {"seeds": [0, 1, 2]}}}}
    evidence = rules.Evidence(values, given={("longer", "touch"): longer.changes(trainings)})

    def judge(e: rules.Evidence) -> rules.Judgement:
        e.networks.add(("touch", "press", "cnn"))
        return rules.positive(pd.Series([1.0, 1.1, 1.2]))

    judged = rules.testable(judge, evidence)
    assert judged.verdict == verdict and judged.ours == pytest.approx(1.1)
    assert (NOT_TESTABLE in judged.verdict) == ("CNN (-2 % with more epochs)" in judged.reason)


def errors_of(values: Mapping[str, float]):
    """Scores of single touches, three seeds near a mean per model."""
    return Scores("touch", lambda protocol, condition, model, metric: values[model] * np.array([0.99, 1.0, 1.01]))


@pytest.mark.parametrize(
    ("errors", "scale", "verdict"),
    [
        ({"cnn": 2.0, "lomp": 1.2}, "paper", REPRODUCED),  # also where CNN alone falls to 1.62
        ({"cnn": 2.0, "lomp": 1.2}, "laptop", NOT_TESTABLE),
        ({"cnn": 2.0, "lomp": 1.7}, "paper", NOT_TESTABLE),  # CNN alone would be ahead after the second gain
        ({"cnn": 0.7, "lomp": 1.5}, "paper", CONTRADICTED),
        ({"cnn": 1.7, "lomp": 1.9}, "paper", NOT_TESTABLE),  # LoMP alone would be ahead
    ],
)
def test_a_verdict_at_the_papers_scale_stays_where_a_longer_training_would_not_change_it(
    monkeypatch, errors, scale, verdict
):
    """Twice the epochs lower the validation error of CNN by 10 %, that of LoMP by 20 %."""
    monkeypatch.setattr(rules.params, "scale_of", lambda experiment, settings: scale)
    epochs = {model: VALUES["touch"]["models"][model]["training"]["epochs"] for model in errors}
    rows = [("press", model, 0, epochs[model], 1.0, 99, {"cnn": 0.9, "lomp": 0.8}[model], 9.0) for model in errors]
    trainings = longer.changes(pd.DataFrame(rows, columns=longer.COLUMNS))
    given = {("scores", "touch"): errors_of(errors), ("longer", "touch"): trainings}

    def judge(e: rules.Evidence) -> rules.Judgement:
        return rules.positive(touch_measures.better(e, "lomp", "cnn"))

    judged = rules.testable(judge, rules.Evidence(VALUES, given))
    assert judged.verdict == verdict
    assert ("stays where test errors fall as validation errors still do" in judged.reason) == (verdict != NOT_TESTABLE)


def test_a_verdict_from_predictions_does_not_stay(monkeypatch):
    """What a longer training would predict is not known."""
    monkeypatch.setattr(rules.params, "scale_of", lambda experiment, settings: "paper")
    epochs = VALUES["touch"]["models"]["cnn"]["training"]["epochs"]
    trainings = pd.DataFrame([("press", "cnn", 0, epochs, 1.0, 99, 0.9, 9.0)], columns=longer.COLUMNS)
    given = {("scores", "touch"): errors_of({"cnn": 1.0}), ("longer", "touch"): longer.changes(trainings)}

    def judge(e: rules.Evidence) -> rules.Judgement:
        e.once(("predictions",), lambda: None)
        return rules.positive(touch_measures.score(e, "cnn"))

    assert rules.testable(judge, rules.Evidence(VALUES, given)).verdict == NOT_TESTABLE


def test_errors_of_a_longer_training():
    values = pd.Series([0.5, 0.9])
    assert longer.with_errors(values, "rmse", 0.8).tolist() == pytest.approx([0.4, 0.72])
    assert longer.with_errors(values, "accuracy", 0.8).tolist() == pytest.approx([0.6, 0.92])
    assert longer.with_errors(values, "r2", 0.8).tolist() == pytest.approx([0.68, 0.936])
