"""Faults put into the code on purpose: does a fast test see each of them?

Run by hand: `python tests/mutants.py` for all, `python tests/mutants.py NAME ...` for some. Every mutant is applied in
a temporary copy of the tracked files, and the tests that should see it are run there, two mutants at a time. Survivors
are listed, with exit status 1. A mutant that no test can see has a reason in `survives`; today none has.
"""

import os
import queue
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path
from typing import NamedTuple

from tqdm import tqdm

ROOT = Path(__file__).resolve().parent.parent
PROCESSES = 2
LIMIT_S = 300  # of one mutant's tests, which take some seconds; of those of all mutants as the code is, four times that
PASSED, FAILED = 0, 1  # exit statuses of pytest; others: it could not run


class Mutant(NamedTuple):
    """One fault: `text`, which occurs once in `file`, becomes `fault`; `tests`, files or node ids, should fail."""

    name: str
    file: str
    text: str
    fault: str
    tests: str  # separated by spaces, without `tests/`
    survives: str = ""  # why no test can see it


class Wrong(Exception):
    """Why the list of mutants cannot be used as it stands."""


SELECTION, CLAIMS = "stages/test_selection.py", "claims/test_verdicts.py"

MUTANTS = [
    # What chooses the epoch of a network, and what is fitted.
    Mutant(
        "windows-stop-on-test",
        "pipeline/tasks/windows.py",
        'regressor.streams) for name in ("train", "validation"))',
        'regressor.streams) for name in ("train", "test"))',
        SELECTION,
    ),
    Mutant(
        "images-stop-on-test",
        "pipeline/tasks/images.py",
        'for name in ("train", "validation"))',
        'for name in ("train", "test"))',
        SELECTION,
    ),
    Mutant(
        "augmentation-scored-on-validation",
        "pipeline/studies/augmentation.py",
        'protocol, seed), "test")',
        'protocol, seed), "validation")',
        SELECTION,
    ),
    Mutant(
        "augmentation-none-keeps-all",
        "pipeline/studies/augmentation.py",
        "off = {name: 0.0 for name in SETTINGS if name not in METHODS[method]}",
        "off = {name: 0.0 for name in SETTINGS if METHODS[method] and name not in METHODS[method]}",
        SELECTION,
    ),
    Mutant(
        "size-ladder-of-touch-stops-on-test",
        "pipeline/studies/sizes.py",
        'for name in ("train", "validation"))',
        'for name in ("train", "test"))',
        SELECTION,
    ),
    Mutant(
        "size-ladder-of-glove-stops-on-test",
        "pipeline/studies/sizes.py",
        "classifier.fit(train, validation,",
        "classifier.fit(train, test,",
        SELECTION,
    ),
    Mutant(
        "ablation-of-touch-scored-on-training",
        "pipeline/stability/changed_scene.py",
        "(part == asked.part) & (condition == name)",
        '(part == "train") & (condition == name)',
        SELECTION,
    ),
    Mutant(
        "ablation-of-glove-scored-on-training",
        "pipeline/stability/changed_scene.py",
        "protocol, seed), asked.part)",
        'protocol, seed), "train")',
        SELECTION,
    ),
    Mutant(
        "stag-stops-on-test",
        "pipeline/studies/stag.py",
        'for name in ("train", "validation"))',
        'for name in ("train", "test"))',
        SELECTION,
    ),
    Mutant(
        "several-frames-stop-on-test",
        "pipeline/studies/joined_frames.py",
        'network.fit(train, windows["validation"],',
        'network.fit(train, windows["test"],',
        "studies/test_input_frames.py",
    ),
    Mutant(
        "sets-of-frames-mix-sessions",
        "pipeline/scoring/frame_sets.py",
        'rows = rows[np.argsort(group[rows], kind="stable")]',
        "group = np.sort(group[rows])",
        "studies/test_input_frames.py",
    ),
    Mutant(
        "networks-keep-the-last-epoch",
        "pipeline/learning/training.py",
        "        network.load_state_dict(best_weights)",
        "        pass",
        "learning/test_training.py",
    ),
    Mutant(
        "networks-of-windows-keep-the-last-epoch",
        "pipeline/learning/regressors.py",
        "epochs, run_epoch, progress=progress)",
        "epochs, run_epoch, progress=progress, keep_last=True)",
        "learning/test_regressors.py",
    ),
    Mutant(
        "networks-of-images-keep-the-last-epoch",
        "pipeline/learning/image_classifier.py",
        "training.epochs, run_epoch, progress=progress)",
        "training.epochs, run_epoch, progress=progress, keep_last=True)",
        "learning/test_image_classifier.py",
    ),
    Mutant(
        "highpass-keeps-the-best-epoch",
        "pipeline/models/lstm_highpass.py",
        "t.epochs, run_epoch, progress=progress, keep_last=True)",
        "t.epochs, run_epoch, progress=progress)",
        "models/test_series_models.py::test_highpass_keeps_its_last_epoch",
    ),
    Mutant(
        "divergence-in-the-last-epoch-is-overlooked",
        "pipeline/learning/training.py",
        "if not np.isfinite(known).all():",
        "if not np.isfinite(known).all() and epoch < epochs:",
        "learning/test_training.py models/test_contract.py::test_divergence_in_the_last_epoch_is_recorded",
    ),
    Mutant(
        "rate-never-falls-to-zero",
        "pipeline/learning/training.py",
        "(1 - done) / (1 - RISE))",
        "max(0.1, (1 - done) / (1 - RISE)))",
        "learning/test_training.py",
    ),
    Mutant(
        "rate-begins-at-its-highest",
        "pipeline/learning/training.py",
        "return min(done / RISE, ",
        "return min(1.0, ",
        "learning/test_training.py",
    ),
    Mutant(
        "rate-of-windows-is-set-once-an-epoch",
        "pipeline/learning/regressors.py",
        "schedule.at((epoch + done) / epochs)",
        "schedule.at(epoch / epochs)",
        "learning/test_regressors.py",
    ),
    Mutant(
        "rate-of-streams-is-set-once-an-epoch",
        "pipeline/models/lomp_stream.py",
        "done = (seen + len(windows) / 2) / len(x)",
        "done = 0.0",
        "models/test_lomp_stream.py::test_the_rate_of_every_update_rises_and_falls_to_zero",
    ),
    Mutant(
        "state-of-streams-grows-without-end",
        "pipeline/models/lomp_stream.py",
        "state if self.network.training else state.clamp(max=LARGEST_STATE)",
        "state",
        "models/test_lomp_stream.py::test_a_state_that_grows_is_cut",
    ),
    Mutant(
        "rate-of-images-is-set-once-an-epoch",
        "pipeline/learning/image_classifier.py",
        "schedule.at((epoch + (first + len(batch) / 2) / len(examples)) / training.epochs)",
        "schedule.at(epoch / training.epochs)",
        "learning/test_image_classifier.py",
    ),
    Mutant(
        "an-epoch-sees-all-windows-at-rest",
        "pipeline/learning/regressors.py",
        "generator=order) < self.training.rest_share",
        "generator=order) < 1",
        "learning/test_regressors.py",
    ),
    Mutant(
        "windows-at-rest-are-the-same-in-every-epoch",
        "pipeline/learning/regressors.py",
        "keep = torch.rand(len(y), generator=order) <",
        "keep = (windows % 100 / 100) <",
        "learning/test_regressors.py",
    ),
    Mutant(
        "labels-are-divided-by-their-spread",
        "pipeline/learning/regressors.py",
        "float(np.abs(train[1]).max()) or 1.0",
        "float(np.std(train[1])) or 1.0",
        "learning/test_regressors.py",
    ),
    Mutant(
        "last-layer-starts-at-random",
        "pipeline/learning/regressors.py",
        "    nn.init.zeros_(layer.weight)\n",
        "",
        "learning/test_regressors.py",
    ),
    Mutant(
        "the-last-batch-may-be-one-window",
        "pipeline/learning/regressors.py",
        "(len(seen) > 1 and",
        "(len(seen) < 1 and",
        "learning/test_regressors.py",
    ),
    Mutant(
        "windows-are-scaled-over-validation",
        "pipeline/learning/regressors.py",
        "mean, spread = input_scale(train[0])",
        "mean, spread = input_scale(np.concatenate([train[0], validation[0]]))",
        "learning/test_regressors.py",
    ),
    Mutant(
        "esn-ends-before-validation",
        "pipeline/learning/series_regressors.py",
        "chosen = [record.counted for *_, record in parts]",
        "chosen = [record.training & record.counted for *_, record in parts]",
        "models/test_series_models.py::test_all_models_of_a_table_are_fitted_to_the_same_samples",
    ),
    Mutant(
        "ridge-ends-before-validation",
        "pipeline/learning/series_regressors.py",
        "(record.counted & record.training if stops else record.counted, ",
        "(record.counted & record.training, ",
        "models/test_series_models.py::test_all_models_of_a_table_are_fitted_to_the_same_samples",
    ),
    Mutant(
        "highpass-ends-before-validation",
        "pipeline/models/lstm_highpass.py",
        "np.pad(np.ones(len(record.x), bool), (self.taps - 1, 0))",
        "np.pad(record.training, (self.taps - 1, 0))",
        "models/test_series_models.py::test_all_models_of_a_table_are_fitted_to_the_same_samples",
    ),
    Mutant(
        "inputs-of-series-are-scaled-over-validation",
        "pipeline/learning/series_regressors.py",
        "[record.x[record.training] for record in records]",
        "[record.x for record in records]",
        "models/test_series_models.py::test_inputs_and_outputs_are_scaled_by_the_training_part_alone",
    ),
    Mutant(
        "outputs-of-series-are-scaled-over-validation",
        "pipeline/learning/series_regressors.py",
        "[record.y[record.training & record.counted] for record in records]",
        "[record.y[record.counted] for record in records]",
        "models/test_series_models.py::test_inputs_and_outputs_are_scaled_by_the_training_part_alone",
    ),
    Mutant(
        "transfer-counts-the-recurrent-part",
        "pipeline/learning/lstm.py",
        "            self.network.lstm.requires_grad_(False)",
        "            self.network.lstm.requires_grad_(True)",
        "models/test_series_models.py::test_published_numbers_of_parameters",
    ),
    Mutant(
        "series-see-the-test-part",
        "pipeline/datasets/series.py",
        "records.append(Record(*(column[: seen[-1] + 1] for column in piece.record)))",
        "records.append(Record(*(column[:] for column in piece.record)))",
        "models/test_series_models.py::test_training_never_gets_the_test_part",
    ),
    Mutant(
        "series-task-hands-over-the-test-part",
        "pipeline/tasks/series.py",
        "records = series.seen_in_training(series.read(path, task, protocol, seed))",
        "records = [piece.record for piece in series.read(path, task, protocol, seed)]",
        SELECTION,
    ),
    # The studies of the latent space, and the probe.
    Mutant(
        "study-scored-on-training",
        "pipeline/studies/latent.py",
        'regressor.predict(piece.record.x)[piece.part == "test"]',
        'regressor.predict(piece.record.x)[piece.part == "train"]',
        "studies/test_latent.py",
    ),
    Mutant(
        "study-takes-first-samples",
        "pipeline/studies/latent.py",
        "column[-samples:]",
        "column[:samples]",
        "studies/test_latent.py",
    ),
    Mutant(
        "decoder-fits-its-held-out-blocks",
        "pipeline/studies/latent.py",
        "fitted, held = block != fold, block == fold",
        "fitted, held = block >= 0, block == fold",
        "models/test_series_models.py::test_decoder_is_tested_on_blocks_that_it_has_not_seen",
    ),
    Mutant(
        "probe-scored-on-training-grasps",
        "pipeline/studies/joint_angles.py",
        'train, test = part == "train", part == "test"',
        'train, test = part == "train", part == "train"',
        "experiments/test_glove_recorded.py::test_the_probe_of_joint_angles_is_scored_on_grasps_that_it_has_not_seen",
    ),
    # Splits and labels.
    Mutant(
        "press-is-on-two-sides",
        "pipeline/experiments/touch.py",
        'windows["press"].to_numpy() if by_press else',
        'windows["press"].to_numpy() if not by_press else',
        "experiments/test_splits.py",
    ),
    Mutant(
        "one-window-is-on-the-other-side",
        "pipeline/experiments/touch.py",
        "    return part\n",
        '    part[np.flatnonzero(part == "test")[:1]] = "train"\n    return part\n',
        "experiments/test_splits.py",
    ),
    Mutant(
        "double-touches-are-trained-on",
        "pipeline/experiments/touch.py",
        'single = np.isin(schemas.names(windows["condition"]), settings["split"].get("train_on", ["single"]))',
        'single = schemas.names(windows["condition"]) != "tape"',
        "experiments/test_splits.py",
    ),
    Mutant(
        "second-day's-places-are-trained-on",
        "pipeline/experiments/strain_recorded.py",
        'if name == "new_places":',
        'if name == "old_places":',
        "experiments/test_strain_recorded.py::test_new_places_trains_on_no_place_of_the_second_day",
    ),
    Mutant(
        "session-is-on-two-sides",
        "pipeline/experiments/glove.py",
        "    return part\n",
        '    part[np.flatnonzero(part == "test")[:1]] = "train"\n    return part\n',
        "experiments/test_glove.py",
    ),
    Mutant(
        "stag-recording-is-on-two-sides",
        "pipeline/studies/stag.py",
        'part[(part == "train") & np.isin(data.recording, kept)]',
        'part[(part == "train") & (np.arange(len(part)) % 10 == 0)]',
        "logs/test_stag.py::test_validation_takes_whole_training_recordings",
    ),
    Mutant(
        "validation-comes-before-training",
        "pipeline/datasets/series.py",
        'np.repeat(["train", "validation", "test"], np.diff',
        'np.repeat(["validation", "train", "test"], np.diff',
        "models/test_series_models.py::test_training_never_gets_the_test_part",
    ),
    Mutant(
        "first-repetition-is-the-test",
        "pipeline/experiments/velostat_recorded.py",
        'if not name.endswith("exp1"):',
        'if not name.endswith("exp2"):',
        "experiments/test_splits.py",
    ),
    Mutant(
        "map-axes-swapped",
        "pipeline/datasets/labels.py",
        '"ntr,ntc->nrc"',
        '"ntr,ntc->ncr"',
        "datasets/test_labels.py",
    ),
    Mutant(
        "sigma-is-the-radius",
        "pipeline/datasets/labels.py",
        "tip_radius_mm, (-1, 1, 1)) / 2",
        "tip_radius_mm, (-1, 1, 1))",
        "datasets/test_labels.py",
    ),
    Mutant(
        "label-is-the-first-frame's",
        "pipeline/datasets/windowing.py",
        "    last = rows[:, -1]\n",
        "    last = rows[:, 0]\n",
        "datasets/test_windowing.py",
    ),
    Mutant(
        "window-is-one-frame-too-long",
        "pipeline/datasets/windowing.py",
        "stop - span + 1, stride)",
        "stop - span + 2, stride)",
        "datasets/test_windowing.py",
    ),
    Mutant(
        "hand-held-touch-moves-between-places",
        "pipeline/experiments/touch.py",
        "place, held=k > 0, longest_s=cnc_s)",
        "place, held=False, longest_s=cnc_s)",
        "stages/test_touch_ingest.py",
    ),
    Mutant(
        "joints-in-reverse",
        "pipeline/experiments/glove.py",
        "joint, cols // joint, joint).mean(axis=(2, 4))",
        "joint, cols // joint, joint).mean(axis=(2, 4))[:, ::-1]",
        "experiments/test_glove.py",
    ),
    Mutant(
        "image-does-not-use-the-whole-range",
        "pipeline/datasets/images.py",
        "np.round(HIGHEST * (matrix - low) / np.where(high > low, high - low, 1))",
        "np.round(HIGHEST * matrix / np.where(high > low, high, 1))",
        "experiments/test_glove.py",
    ),
    Mutant(
        "rejects-dropped",
        "pipeline/stages/ingest.py",
        "            rejects.append(rejected)",
        "            pass",
        "stages/test_touch_ingest.py",
    ),
    # Physics and models.
    Mutant(
        "crosstalk-by-row",
        "pipeline/scenes/readout.py",
        "reference_s + conductance.sum(axis=1)",
        "reference_s + conductance.sum(axis=2)",
        "scenes/test_touch_scene.py",
    ),
    Mutant(
        "crosstalk-without-the-bottom-row",
        "pipeline/scenes/readout.py",
        "reference_s + conductance.sum(axis=1)",
        "reference_s + conductance[:, 1:].sum(axis=1)",
        "scenes/test_touch_scene.py",
    ),
    Mutant(
        "ablation-without-seed",
        "pipeline/datasets/specimens.py",
        "scene[name] + specimen for name",
        "scene[name] for name",
        "reporting/verdicts/test_physics_verdicts.py::test_settings_switch_one_effect_and_move_the_seed",
    ),
    Mutant(
        "lomp-without-one-neighbour",
        "pipeline/learning/lomp_network.py",
        "    return (distance == 1).float()",
        "    return ((distance == 1) & (index[:, None] - index != 1)).float()",
        "learning/test_lomp_network.py::test_neighbours_of_corner_edge_and_centre",
    ),
    Mutant(
        "lomp-without-alpha",
        "pipeline/learning/lomp_network.py",
        "s.view(cells, -1), alpha=alpha, out",
        "s.view(cells, -1), alpha=1.0, out",
        "learning/test_lomp_network.py::test_outputs_and_all_gradients_equal_a_loop_over_modules",
    ),
    Mutant(
        "lomp-row-without-candidate-bias",
        "pipeline/learning/lomp_prediction.py",
        "candidate_inputs[j] + candidate_bias[j] + r[j]",
        "candidate_inputs[j] + r[j]",
        "learning/test_lomp_network.py::test_a_row_in_compiled_code_is_a_row_of_a_batch",
    ),
    Mutant(
        "gcam-without-sigmoid",
        "pipeline/learning/residual_blocks.py",
        "self.row_weights = nn.Sequential(nn.Conv2d(narrow, channels, 1), nn.Sigmoid())",
        "self.row_weights = nn.Sequential(nn.Conv2d(narrow, channels, 1), nn.Identity())",
        "models/test_image_models.py::test_attention_weighs_rows_and_columns",
    ),
    Mutant(
        "gcam-without-columns",
        "pipeline/learning/residual_blocks.py",
        "return x * rows * columns",
        "return x * rows",
        "models/test_image_models.py::test_attention_weighs_rows_and_columns",
    ),
    Mutant(
        "noise-is-never-drawn",
        "pipeline/learning/image_classifier.py",
        "images = images + training.noise * torch.randn",
        "images = images + 0 * torch.randn",
        "learning/test_image_classifier.py",
    ),
    # Scores, times and statistics.
    Mutant(
        "location-searched-in-half-the-radius",
        "pipeline/scoring/metrics.py",
        'near = away <= sensor["pitch_mm"]',
        'near = away <= sensor["pitch_mm"] / 2',
        "scoring/test_metrics.py",
    ),
    Mutant(
        "press-scored-from-its-start",
        "pipeline/scoring/metrics.py",
        "slice(start + count // 2, start + count)",
        "slice(start, start + count)",
        "scoring/test_metrics.py::test_scores_of_known_predictions",
    ),
    Mutant(
        "r2-against-zero",
        "pipeline/scoring/metrics.py",
        "total = np.square(truth - truth.mean(dtype=np.float64), dtype=np.float64).sum()",
        "total = np.square(truth, dtype=np.float64).sum()",
        "scoring/test_metrics.py",
    ),
    Mutant(
        "failed-run-keeps-its-scores",
        "pipeline/scoring/metrics.py",
        'float("nan") if failed else value, n)',
        "value, n)",
        "learning/test_trained.py",
    ),
    Mutant(
        "recall-for-precision",
        "pipeline/scoring/classification.py",
        "np.diag(table), table.sum(axis=0)",
        "np.diag(table), table.sum(axis=1)",
        "scoring/test_classification.py",
    ),
    Mutant(
        "latency-without-warm-up",
        "pipeline/stages/latency.py",
        "return np.array(taken[warm_up:])",
        "return np.array(taken[:calls])",
        "stages/test_latency.py",
    ),
    Mutant(
        "latency-with-two-threads-of-torch",
        "pipeline/stages/latency.py",
        'torch.set_num_threads(settings["threads"])',
        "torch.set_num_threads(2)",
        "stages/test_latency.py",
    ),
    Mutant(
        "latency-with-two-threads-of-numpy",
        "pipeline/stages/latency.py",
        'with threadpool_limits(settings["threads"]):',
        "with threadpool_limits(2):",
        "stages/test_latency.py",
    ),
    Mutant(
        "fastest-training-in-place-of-the-median",
        "pipeline/stages/latency.py",
        "return statistics.median(",
        "return min(",
        "stages/test_latency.py",
    ),
    Mutant(
        "ddof-0",
        "pipeline/scoring/results.py",
        "seen.std(ddof=1)",
        "seen.std(ddof=0)",
        "reporting/test_touch_report.py::test_estimate_and_numbers",
    ),
    Mutant(
        "t-with-n",
        "pipeline/scoring/results.py",
        "t.ppf((1 + CONFIDENCE) / 2, n - 1)",
        "t.ppf((1 + CONFIDENCE) / 2, n)",
        "reporting/test_touch_report.py::test_estimate_and_numbers",
    ),
    Mutant(
        "size-is-enough-by-its-mean",
        "pipeline/reporting/verdicts/sizes.py",
        "excess.high <= MARGIN",
        "excess.mean <= MARGIN",
        "studies/test_sizes.py",
    ),
    Mutant(
        "interval-of-pairs-without-root",
        "pipeline/reporting/verdicts/physics.py",
        "/ np.sqrt(len(ratio))",
        "/ len(ratio)",
        "reporting/verdicts/test_physics_verdicts.py::test_the_interval_is_that_of_two_one_sided_tests",
    ),
    Mutant(
        "tolerance-of-agreement-is-two-percent-alone",
        "pipeline/stages/agreement.py",
        "np.maximum(spread, LEAST * ",
        "np.maximum(0 * spread, LEAST * ",
        "stages/test_agreement.py",
    ),
    # Stress.
    Mutant(
        "half-the-noise",
        "pipeline/stability/perturbations.py",
        "readings + severity * span * rng.standard_normal(readings.shape))",
        "readings + severity * span / 2 * rng.standard_normal(readings.shape))",
        "stability/test_perturbations.py",
    ),
    Mutant(
        "failure-at-three-times-what-is-usable",
        "pipeline/reporting/verdicts/stability.py",
        "if seeds.mean > usable:",
        "if seeds.mean > 3 * usable:",
        "reporting/test_stability_report.py",
    ),
    Mutant(
        "relative-error-with-the-clean-one",
        "pipeline/reporting/verdicts/stability.py",
        "for severity in errors if severity != 0]",
        "for severity in errors]",
        "reporting/test_stability_report.py",
    ),
    # Verdicts.
    Mutant(
        "tolerance-20-percent",
        "pipeline/claims/rules.py",
        "TOLERANCE = 0.1 ",
        "TOLERANCE = 0.2 ",
        CLAIMS,
    ),
    Mutant(
        "undecided-is-reproduced",
        "pipeline/claims/rules.py",
        "return REPRODUCED if low > limit else",
        "return REPRODUCED if high > limit else",
        CLAIMS,
    ),
    Mutant(
        "band-25-percent",
        "pipeline/claims/rules.py",
        "BAND = 0.15 ",
        "BAND = 0.25 ",
        CLAIMS,
    ),
    Mutant(
        "places-within-one",
        "pipeline/claims/rules.py",
        "margin=0.5)",
        "margin=1.5)",
        CLAIMS,
    ),
    Mutant(
        "any-rank-is-among-the-worst",
        "pipeline/claims/rules.py",
        "rank.iloc[0] > worst",
        "rank.iloc[0] > worst + 1",
        CLAIMS,
    ),
    Mutant(
        "unpaired",
        "pipeline/claims/evidence.py",
        "index=seeds[places])",
        "index=range(len(places)))",
        CLAIMS,
    ),
    Mutant(
        "whole-runs-alone-stay",
        "pipeline/claims/evidence.py",
        "self.whole &= key in self._whole",
        "self.whole &= True",
        "claims/test_unended.py",
    ),
    Mutant(
        "margin-of-lomp-like-rnn-0.5",
        "pipeline/claims/lomp.yaml",
        "margin: 0.1",
        "margin: 0.5",
        CLAIMS,
    ),
    Mutant(
        "attention-reversed",
        "pipeline/claims/sp_resnet.yaml",
        "100 * ({images}.sp_resnet - {images}.sp_resnet_nogcam)",
        "100 * ({images}.sp_resnet_nogcam - {images}.sp_resnet)",
        CLAIMS,
    ),
    Mutant(
        "high-pressure-on-all-rows",
        "pipeline/scoring/claim_inputs.py",
        "chosen = tested & (schemas",
        "chosen = (schemas",
        "scoring/test_claim_inputs.py",
    ),
    Mutant(
        "high-pressure-above-100-kpa",
        "pipeline/scoring/claim_inputs.py",
        "HIGH_KPA = 200.0 ",
        "HIGH_KPA = 100.0 ",
        "scoring/test_claim_inputs.py",
    ),
    Mutant(
        "published-number-changed",
        "pipeline/scoring/published.csv",
        "lomp,Table I,LoMP,double touch,RMSE,7.49,kPa",
        "lomp,Table I,LoMP,double touch,RMSE,9.49,kPa",
        CLAIMS,
    ),
]


def check(mutants: Sequence[Mutant]) -> None:
    """Raise Wrong where a name is not unique, or a text does not occur exactly once in its file."""
    names = [mutant.name for mutant in mutants]
    if repeated := sorted({name for name in names if names.count(name) > 1}):
        raise Wrong(f"two mutants are called {repeated[0]}")
    for mutant in mutants:
        if (times := (ROOT / mutant.file).read_text(encoding="utf-8").count(mutant.text)) != 1:
            raise Wrong(f"{mutant.name}: its text occurs {times} times in {mutant.file}, not once; bring it up to date")


def chosen(names: Sequence[str]) -> list[Mutant]:
    """Return the mutants of these names, or all."""
    if unknown := set(names) - {mutant.name for mutant in MUTANTS}:
        raise Wrong(f"there is no mutant {sorted(unknown)[0]}; the names are in {Path(__file__).name}")
    return [mutant for mutant in MUTANTS if not names or mutant.name in names]


def copy_to(folder: Path) -> Path:
    """Copy the tracked files, as they are now, to the new `folder`."""
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, check=True, capture_output=True, text=True).stdout
    for name in filter(None, listed.split("\0")):
        target = folder / name
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(ROOT / name, target, follow_symlinks=False)
    return folder


def run(folder: Path, tests: Sequence[str], limit_s: float = LIMIT_S) -> tuple[int, str]:
    """Run tests in a copy until the first that fails; pytest's exit status and what it printed."""
    environment = os.environ | {"PYTHONPATH": str(folder), "OMP_NUM_THREADS": "1", "PYTHONDONTWRITEBYTECODE": "1"}
    command = [
        sys.executable,
        "-m",
        "pytest",
        "-x",
        "-q",
        "-p",
        "no:cacheprovider",
        *(f"tests/{name}" for name in tests),
    ]
    try:
        done = subprocess.run(
            command, cwd=folder, env=environment, capture_output=True, text=True, timeout=limit_s, check=False
        )
    except subprocess.TimeoutExpired:
        return -1, f"not finished after {limit_s} s"
    return done.returncode, done.stdout + done.stderr


def survives(folder: Path, mutant: Mutant) -> str:
    """Return what is wrong with a mutant, or nothing where its tests see it; `folder`: a copy, left as it was."""
    file = folder / mutant.file
    source = file.read_text(encoding="utf-8")
    file.write_text(source.replace(mutant.text, mutant.fault), encoding="utf-8")
    try:
        status, said = run(folder, mutant.tests.split())
    finally:
        file.write_text(source, encoding="utf-8")
    if status == FAILED:
        return f"{mutant.name}: is seen, so it needs no reason to survive" if mutant.survives else ""
    if status == PASSED:
        return f"{mutant.name}: survives {mutant.tests}" + f" ({mutant.survives})" * bool(mutant.survives)
    return f"{mutant.name}: its tests could not run (pytest: {status})\n{said[-2000:]}"


def main(names: Sequence[str]) -> int:
    """Apply the named mutants, or all; 1 where one survives without a reason."""
    mutants = chosen(names)
    check(MUTANTS)
    with tempfile.TemporaryDirectory() as name, ThreadPoolExecutor(PROCESSES) as pool:
        copies: queue.SimpleQueue = queue.SimpleQueue()
        for k in range(PROCESSES):
            copies.put(copy_to(Path(name) / str(k)))

        def in_a_copy(function, *arguments):
            folder = copies.get()
            try:
                return function(folder, *arguments)
            finally:
                copies.put(folder)

        tests = sorted({test for mutant in mutants for test in mutant.tests.split()})
        halves = [half for half in (tests[::2], tests[1::2]) if half]
        for status, said in pool.map(lambda half: in_a_copy(run, half, 4 * LIMIT_S), halves):
            if status != PASSED:
                raise Wrong(f"the tests do not pass as the code is:\n{said[-4000:]}")
        found = []
        with tqdm(total=len(mutants), desc="mutants", unit="mutant") as bar:
            for future in as_completed([pool.submit(in_a_copy, survives, mutant) for mutant in mutants]):
                if wrong := future.result():
                    found.append(wrong)
                    bar.write(wrong)
                bar.update()
    explained = {mutant.name for mutant in mutants if mutant.survives}
    bad = [wrong for wrong in found if not (wrong.split(":")[0] in explained and ": survives " in wrong)]
    print(f"{len(mutants)} mutants, {len(mutants) - len(found)} seen, {len(bad)} to look at", *bad, sep="\n")
    return int(bool(bad))


if __name__ == "__main__":
    try:
        sys.exit(main(sys.argv[1:]))
    except Wrong as error:
        sys.exit(f"error: {error}")
