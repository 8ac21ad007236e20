"""Log results as runs of MLflow, from files alone: means over seeds of the evidence, and each training of the look.

A run is known by its content, a digest of settings, scores, and shards or weights. So a second call logs nothing, and a
changed result is a new run. No run is ever deleted or changed, but for its tags `current` ("true" where the last call
found its content among the results), `shown` (of the budget whose numbers the reports show), `compared` (of these the
one that stands for its model on a protocol) and `readme` (with a number in README.md beside a paper's), of which
pipeline/results/shown.py tells. Times are no part of the content.
"""

import hashlib
import importlib.metadata
import json
import os
import re
import shutil
import tempfile
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
from tqdm import tqdm

from pipeline.results import one_table, published, shards, shown
from pipeline.results.claim_inputs import FULL, HALF, LOOK
from pipeline.results.one_table import TRAIN_S, Results
from tactile.base import files, params, paths, provenance
from tactile.base.availability import why_not_run
from tactile.base.errors import InputError
from tactile.base.paths import Workspace
from tactile.datasets import fits
from tactile.drawing import labels
from tactile.experiments import facts
from tactile.inference import card as cards
from tactile.inference import mlflow_store
from tactile.scoring import estimates, units

CODE = paths.CODE / "inference" / "mlflow_model.py"
# What a loaded model imports, and pandas, which MLflow hands it tables with. MLflow finds this out in seconds a model.
REQUIRED = (
    *("numba", "numpy", "pandas", "pyarrow", "pydantic", "ruamel.yaml", "safetensors", "scikit-learn", "scipy"),
    *("skops", "threadpoolctl", "torch"),
)
PREDICTED = 4  # readings of the input example that have a prediction
CURVES = ("train_loss", "validation_loss", "learning_rate")
COUNTS = ("best_epoch", "epochs", "parameters", "macs")
PER_CALL = 1000  # metrics that MLflow takes at once
NOTE = "mlflow.note.content"  # the tag that MLflow shows as the description of a run or an experiment
ERRORS = tuple(f".{metric}" for metric in shown.COMPARED)  # how the names end of what models are compared by
SCORE = ["condition", "metric", "unit"]
NONE = (
    "none"  # variant of the models in the tables; budget of models without epochs, and of variants of their own recipe
)
ABOUT = (
    "a run per model, protocol, variant and budget of training (`full`, `half`), the mean over seeds of the committed "
    "evidence; and where `dvc repro` was run, one per training of it (budget `look`). `main/<condition>.<metric>` is a "
    "score on the test part in the unit of the tag `unit.<metric>`, `errors/` what a share lacks to 1, `published/` "
    "what the paper prints, in the score's unit, on its own split, `seeds/` each seed's score, with the seed as the "
    "step. The duration is that of training. `readme` is true for what stands in README.md beside a paper's numbers."
)
MARKS = ("current", "shown", "compared", "readme")  # tags of runs that a later call may change
NOT_TAKEN = re.compile(r"[^\w.\- ]")  # letters that MLflow does not take in a metric's name


class Run(NamedTuple):
    """One run as files say; of a training with the folder of its model."""

    name: str
    tags: dict[str, str]  # what it is of, units, how a training ended, and the content
    params: dict[str, str]  # the model's block of settings, as `training.epochs` -> "40"
    points: list[tuple[str, float, int]]  # (metric, value, step)
    train_s: float
    folder: Path | None = None


def _run(experiment: str, of: Mapping[str, str], seeds: str, content: list, scores: pd.DataFrame, **more) -> Run:
    """Return a run without its curves; of: its model, protocol and budget; scores: condition, metric, unit and value.

    Raises InputError for two rows of the same name.
    """
    points, tags = {}, {}
    for row in scores.itertuples():
        base = f"{NOT_TAKEN.sub('_', row.condition)}.{row.metric}"
        if (name := f"{'main' if base.endswith(ERRORS) else 'more'}/{base}") in points:
            raise InputError(f"two rows for the same condition and metric of {', '.join(of.values())}, {seeds}")
        points[name], tags[f"unit.{row.metric}"] = float(row.value), str(row.unit)
        if np.isfinite(printed := published.score(experiment, of["model"], row.condition, row.metric)):
            points[f"published/{base}"] = printed
    identity = [experiment, *of.values(), seeds, *content, points]
    tags["content"] = hashlib.sha256(json.dumps(identity, sort_keys=True).encode()).hexdigest()
    shares = {name: x for name, x in points.items() if estimates.scale_of(name.rpartition(".")[2]) == estimates.SHARE}
    lacking = {f"errors/{name[5:]}": 1 - x for name, x in shares.items() if name.startswith("main/")}
    label, variant = labels.model_name(of["model"]), of.get("variant", NONE)
    told = [label, of["protocol"], *[variant] * (variant != NONE)]
    name = ", ".join([*told, *[f"{of['budget']} budget"] * (of["budget"] in (HALF, FULL)), seeds])
    settings = {**of, "variant": variant, "model": label}
    listed = [(key, value, 0) for key, value in {**points, **lacking}.items()]
    return Run(name, tags | of | {"variant": variant, "experiment": experiment}, settings, listed, **more)


def evidence(workspace: Workspace, kept: Results) -> dict[str, list[Run]]:
    """Return the committed results of each experiment, of what a training is of (shown.OF) the mean over seeds.

    kept: of shown.evidence. Commit, machines and curves are those of the shards that the numbers are of.
    """
    rows, index = kept.table, shards.table(shards.folder(workspace) / "index.csv", shards.INDEX)
    if rows.empty:
        return {}
    sets, curves = shards.read_sets(workspace), dict(list(shown.curves(workspace, index["shard"]).groupby("shard")))
    timed = shards.trainings(workspace).rename(columns={TRAIN_S: "value"})
    times = dict(list(timed.groupby(["experiment", "protocol", "model"])))
    rows = rows[(rows["metric"] != TRAIN_S) & ~rows["metric"].str.endswith(units.SUFFIX)]
    runs: dict[str, list[Run]] = {}
    for key, group in rows.groupby(shown.OF):
        if not group["metric"].isin(shown.COMPARED).any():  # a property of the data, not a model
            continue
        of = {name: value or NONE for name, value in zip(shown.OF, key, strict=True)}
        experiment, origin = of.pop("experiment"), shown.origin(index, group["shard"])
        changed = shown.changed(sets, origin.shards, of["model"], key[3])
        settings = {name: " or ".join(sorted(each)) for name, each in changed.items()}
        each = [(row.condition, row.metric, int(row.seed), row.value) for row in group.itertuples()]
        means = [
            (*at, estimates.estimate(values, estimates.scale_of(at[1])).mean)
            for at, values in group.groupby(SCORE, sort=False)["value"]
        ]
        count = group["seed"].nunique()
        said = f"{count} seed{'s' * (count > 1)}"
        timed_on, train_s = _timed(times.get((experiment, of["protocol"], of["model"])), origin)
        content, scores = [sorted(each), settings, origin], pd.DataFrame(means, columns=[*SCORE, "value"])
        run = _run(experiment, of, said, content, scores, train_s=train_s)
        run.params.update((name, value) for name, value in settings.items() if name not in run.params)
        names = {"git_commit": origin.commits, "machine": origin.machines, "shards": origin.shards}
        names["timed_on"] = timed_on
        run.tags.update({name: "; ".join(found) for name, found in names.items() if found})
        failed = group[group["value"].isna()]["seed"].nunique()
        run.points.extend([("more/seeds", count, 0), ("more/failed_seeds", failed, 0)])
        run.points.extend([(f"more/{TRAIN_S}", train_s, 0)] * bool(np.isfinite(train_s)))
        of_seeds = [(f"seeds/{NOT_TAKEN.sub('_', at)}.{metric}", x, seed) for at, metric, seed, x in each]
        run.points.extend(point for point in of_seeds if point[0].endswith(ERRORS))
        run.points.extend(_curve([curves[name] for name in origin.shards if name in curves], of))
        runs.setdefault(experiment, []).append(run)
    return runs


def _timed(times: pd.DataFrame | None, origin: shown.Origin) -> tuple[list[str], float]:
    """Return the machine that did most of the trainings of shards, and the mean of its seconds; NaN where none is kept.

    times: rows of metric TRAIN_S, with their machine. The seconds of two machines, a core and a card, have no mean.
    """
    own = pd.DataFrame(columns=["machine", "value"]) if times is None else times[times["shard"].isin(origin.shards)]
    most = own["machine"].mode()[:1]
    return [*most], float(own[own["machine"].isin(most)]["value"].mean())


def _curve(kept: list[pd.DataFrame], of: Mapping[str, str]) -> Iterator[tuple[str, float, int]]:
    """Yield the losses of a model by epoch, the mean over its seeds, at the epochs that all of them have.

    kept: tables of shown.curves. A loss for each seed would be five times the points, in charts of 20 lines a model.
    """
    if not kept:
        return
    table = pd.concat(kept)
    table = table[(table["model"] == of["model"]) & (table["protocol"] == of["protocol"])]
    of_epoch = table.groupby("epoch")
    whole = of_epoch["seed"].nunique() == table["seed"].nunique()
    for row in of_epoch[shown.CURVES].mean()[whole].itertuples():
        yield from ((loss, float(getattr(row, loss)), int(row.Index)) for loss in shown.CURVES)


def look(workspace: Workspace, experiment: str, values: Mapping) -> Iterator[Run]:
    """Yield every training that params.yaml (`values`) lists for an experiment: model, then protocol, then seed.

    Raises InputError that names the first file, column or row that is missing, or the first model made with other
    settings: a run is complete, or it is not logged.
    """
    settings, made_by, file = values[experiment], params.training_command(experiment), workspace.scores(experiment)
    columns = ["protocol", "condition", "model", "seed", "metric", "unit", "value"]
    scores = estimates.read_csv(file, columns, "dvc repro evaluate")
    latency = estimates.read_latency(workspace, experiment, settings)
    for model in settings["models"]:
        speed = {f"latency.batch_{n}.p50_ms": latency[model, n]["p50_ms"] for n in settings["latency"]["batches"]}
        timed = workspace.training_times(experiment, model)
        times = estimates.read_csv(timed, ["protocol", "seed", "train_s"], made_by).set_index(["protocol", "seed"])
        for protocol, seed in params.runs(values, experiment):
            if (protocol, seed) not in times.index:
                raise InputError(f"{timed}: no row for protocol {protocol}, seed {seed}; run `{made_by}` again")
            folder = workspace.run_folder(experiment, model, protocol, seed)
            history = estimates.read_csv(folder / "history.csv", ["epoch", *CURVES], made_by)
            fit = fits.read_as_set(folder, values, experiment, model, protocol)
            flat = pd.json_normalize(fit["settings"]).to_dict("records")[0] if fit["settings"] else {}
            flat = {name: value if isinstance(value, str) else json.dumps(value) for name, value in flat.items()}
            of_run = scores[(scores.protocol == protocol) & (scores.model == model) & (scores.seed == seed)]
            if of_run.empty:
                problem = f"{file}: no row for protocol {protocol}, model {model}, seed {seed}"
                raise InputError(f"{problem}; run `dvc repro evaluate` again")
            of = {"model": model, "protocol": protocol, "budget": LOOK}
            train_s, digest = float(times.train_s[protocol, seed]), files.sha256(cards.weights_file(folder))
            try:
                run = _run(experiment, of, f"seed {seed}", [flat, digest], of_run, train_s=train_s, folder=folder)
            except InputError as error:
                raise InputError(f"{file}: {error}; run `dvc repro evaluate` again") from error
            run.tags.update({name: str(fit[name]) for name in ("stop_reason", "precision")}, seed=str(seed))
            run.params.update(flat, seed=str(seed))
            more = {name: float(fit[name]) for name in COUNTS if fit[name] is not None}
            run.points.extend((f"more/{name}", x, 0) for name, x in {**more, **speed, "train_s": train_s}.items())
            curves = history.melt("epoch", CURVES)
            run.points.extend((row.variable, row.value, int(row.epoch)) for row in curves.itertuples())
            yield run


def track(workspace: Workspace, values: dict) -> list[str]:
    """Log the runs of all experiments of the settings (`values`), print and return the links that compare their models.

    Raises InputError if a file is missing or was made with other settings (nothing is logged then), or the store
    cannot be used.
    """
    kept = shown.evidence(workspace, one_table.of_own_logs(values))
    committed, runs, looked = evidence(workspace, kept), {}, []
    for experiment in values["experiments"]:
        runs[experiment] = committed.get(experiment, [])
        if not (workspace.ingest_report(experiment).exists() or workspace.models(experiment).exists()):
            continue
        if reason := why_not_run(workspace, experiment):
            print(f"{experiment}: not run here ({reason})")
        else:
            runs[experiment] += look(workspace, experiment, values)
            looked.append(experiment)
    provenance.check_settings(workspace, looked, values)
    links = []
    with mlflow_store.opened(workspace) as client:
        for experiment, of_experiment in runs.items():
            if not of_experiment:
                print(f"{experiment}: no shard of the evidence, nor trained here, so nothing to track")
                continue
            new, link = log(workspace, client, experiment, values, of_experiment, kept)
            print(f"{experiment}: {new} of {len(of_experiment)} runs are new in MLflow; compare them at {link}")
            links.append(link)
    return links


def log(
    workspace: Workspace, client, experiment: str, values: Mapping, runs: list[Run], kept: Results
) -> tuple[int, str]:
    """Log those of `runs` that the store lacks, and mark all of them as the current ones.

    client: MlflowClient; kept: of shown.evidence. Return the number of new runs, and the link that compares the models
    by their main error.
    """
    in_mlflow = mlflow_store.experiment_id(workspace, client, experiment)
    held, token = [], ""
    while token is not None:
        page = client.search_runs([in_mlflow], "tags.content LIKE '%'", page_token=token or None)
        held, token = held + list(page), page.token or None
    for run in held:
        if run.info.status == "RUNNING":  # what a call that was killed left half-way
            client.set_terminated(run.info.run_id, "KILLED")
    known = {run.data.tags["content"]: run.info.run_id for run in held if run.info.status == "FINISHED"}
    new = [run for run in runs if run.tags["content"] not in known]
    marks = _marks(experiment, runs, kept)
    known |= _write(workspace, client, in_mlflow, experiment, values, new, marks)
    of_id = {known[content]: tags for content, tags in marks.items()}
    for run in held:  # after the new ones are complete
        for tag, mark in of_id.get(run.info.run_id, dict.fromkeys(MARKS, "false")).items():
            if run.data.tags.get(tag) != mark:
                client.set_tag(run.info.run_id, tag, mark)
    protocols, score = facts(experiment).compared, facts(experiment).score
    protocol = next((at for at in protocols if any(run.tags["protocol"] == at for run in runs)), "")
    first = next((run for run in runs if run.tags["protocol"] == protocol), runs[0])
    score = score if score in [name for name, _, _ in first.points] else first.points[0][0]
    less = score.startswith("errors/") or estimates.scale_of(score.rpartition(".")[2]) in (
        estimates.PLAIN,
        estimates.LOG,
    )
    return len(new), mlflow_store.link(in_mlflow, first.tags["protocol"], score, less)


def _marks(experiment: str, runs: list[Run], kept: Results) -> dict[str, dict[str, str]]:
    """Return content -> the tags MARKS of runs: what people are shown of the present ones; kept: of shown.evidence."""
    in_readme, marks = shown.readme(kept, experiment), {}
    for run in runs:
        of = ["" if run.tags[name] == NONE else run.tags[name] for name in shown.OF]
        _, protocol, model, variant, budget = of
        in_tables = shown.is_shown(kept, experiment, protocol, variant, budget)
        stands = budget == LOOK or variant == shown.variant_of(experiment, protocol, model)
        said = (True, in_tables, in_tables and stands, tuple(of) in in_readme)
        marks[run.tags["content"]] = dict(zip(MARKS, (str(each).lower() for each in said), strict=True))
    return marks


def _write(
    workspace: Workspace, client, in_mlflow: str, experiment: str, values: Mapping, new: list[Run], marks: Mapping
) -> dict[str, str]:
    """Log the runs `new`; return content -> id. A run is FINISHED only when all of it has been logged.

    marks: see `_marks`. Only a training of this machine is of the commit that is checked out.
    """
    from mlflow.entities import Metric, Param  # here, because mlflow_store says first how MLflow starts

    commit, changed = provenance.git_state(workspace)
    here = {"git_commit": commit, "git_changed": changed, "version": provenance.version()}
    if "DVC_EXP_NAME" in os.environ:
        here["dvc_experiment"] = os.environ["DVC_EXP_NAME"]
    name, written = labels.experiment_name(experiment), {}
    if new:
        client.set_experiment_tag(in_mlflow, NOTE, f"{name}: {ABOUT}")
    with tempfile.TemporaryDirectory() as drafts:
        models = Models(workspace, experiment, values, commit, Path(drafts)) if any(run.folder for run in new) else None
        for run in tqdm(new, desc=f"track {experiment}", unit="run"):
            now = int(time.time() * 1000)  # files hold no date: a run ends now, and lasts as long as its training did
            lasts = 0 if np.isnan(run.train_s) else round(1000 * run.train_s)
            folder, told = models.draft(run) if run.folder else (None, [])
            note = "\n\n".join([f"{run.name} ({name}).", *told])
            tags = run.tags | (here if run.folder else {}) | marks[run.tags["content"]] | {NOTE: note}
            run_id = client.create_run(in_mlflow, now - lasts, tags, run.name).info.run_id
            # a diverged fit ends in a NaN, which no chart can draw; `stop_reason` says it
            points = [Metric(key, x, now, step) for key, x, step in run.points if np.isfinite(x) or key not in CURVES]
            settings = [Param(key, value) for key, value in run.params.items()]
            for first in range(0, len(points), PER_CALL):
                client.log_batch(run_id, points[first : first + PER_CALL], () if first else settings)
            if folder:
                client.log_artifacts(run_id, str(folder))
            client.set_terminated(run_id, end_time=now)
            written[run.tags["content"]] = run_id
    return written


class Models:
    """Makes the files of trainings: settings, curve, and a model that MLflow opens; nothing in it is pickled."""

    def __init__(self, workspace: Workspace, experiment: str, values: Mapping, commit: str, drafts: Path):
        from tactile.inference import training_logs  # here, because the import of torch takes 2 s
        from tactile.inference.describer import Describer

        self.describer, self.commit, self.drafts = Describer(workspace, values, experiment), commit, drafts
        digests = training_logs.digests(workspace, values[experiment], experiment)
        self.with_logs = lambda card: training_logs.added(workspace, values[experiment], card, digests)
        self.readings, self.saved = self.describer.readings(), {}
        self.settings = [
            file for file in params.settings_files(workspace.params) if file.stem in ("params", experiment)
        ]

    def draft(self, run: Run) -> tuple[Path, list[str]]:
        """Return the folder of a training's files, and sentences on what its model takes and gives."""
        card = self.describer.card(run.tags["model"], run.tags["protocol"], int(run.tags["seed"]), self.commit)
        card = self.with_logs(card)
        told, weights, folder = _told(card), cards.weights_file(run.folder), self.drafts / "run"
        key = (weights.name, card.reach(), *told.values())
        if key not in self.saved:  # a second for MLflow; models alike but for their weights are copied
            self.saved[key] = self.drafts / str(len(self.saved))
            self._save(self.saved[key], card, weights, told)
        shutil.rmtree(folder, ignore_errors=True)
        shutil.copytree(self.saved[key], folder / mlflow_store.MODEL)
        shutil.copy(weights, folder / mlflow_store.PACKAGE)
        cards.write(folder / mlflow_store.PACKAGE, card)
        for file in (*self.settings, run.folder / "fit.json", run.folder / "history.csv"):
            shutil.copy(file, folder)
        return folder, list(told.values())

    def _save(self, target: Path, card: cards.Card, weights: Path, told: dict[str, str]) -> None:
        import mlflow.pyfunc
        from mlflow.models import ModelSignature
        from mlflow.types import Schema, TensorSpec

        number = np.dtype("float32")
        taken, predicted = TensorSpec(number, (-1, card.inputs.columns)), TensorSpec(number, (-1, *card.output_shape))
        cards.write(self.drafts, card)
        mlflow.pyfunc.save_model(
            target,
            python_model=str(CODE),
            artifacts={"card": str(self.drafts / cards.NAME), "weights": str(weights)},
            signature=ModelSignature(Schema([taken]), Schema([predicted])),
            input_example=self.readings[: card.reach() + PREDICTED],
            pip_requirements=[f"{name}=={importlib.metadata.version(name).partition('+')[0]}" for name in REQUIRED],
            metadata=told,
        )


def _told(card: cards.Card) -> dict[str, str]:
    """Say in words what a model takes and gives, with shapes and units."""
    inputs, outputs = card.inputs, card.outputs
    said = f"float32 ({', '.join(map(str, ('n', *card.output_shape)))}) in {outputs.unit}, one per reading"
    if outputs.names:
        said += f": {', '.join(outputs.names)}"
    if before := card.reach():
        said += f"; where a model takes whole windows, NaN for the first {before}"
    taken = f"float32 (n, {inputs.columns}) in {inputs.unit}, {inputs.order}; one every {inputs.interval_s:g} s"
    return {"readings": f"Readings: {taken}.", "predictions": f"Predictions: {said}."}
