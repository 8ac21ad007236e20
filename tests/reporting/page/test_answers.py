"""The answers of README.md and the page: tables and findings, from the evidence alone."""

import pandas as pd
import pytest
import yaml
from builders import made_array, made_evidence
from builders.project import ROOT

from pipeline.reporting.page import answers, claims, origins
from pipeline.reporting.page.hypertext import FOLDER
from pipeline.results import one_table, shown
from pipeline.results.claim_inputs import COLUMNS, FULL, LOOK
from tactile.base import params
from tactile.base.errors import InputError
from tactile.base.paths import Workspace

CONTENT = yaml.safe_load((FOLDER / "content.yaml").read_text(encoding="utf-8"))
VALUES = params.load(Workspace(ROOT).params)
ERRORS = {"constant": 17.0, "linear_array": 14.0, "lomp": 8.0, "lomp_stream": 9.0, "convlstm": 10.0}


def judged(**ours) -> pd.DataFrame:
    """Rows of claims.csv: those that findings are about, and one of a table; ours: verdicts of claims."""
    names = [asked["claim"] for of in CONTENT["answers"].values() for asked in of["findings"] if "claim" in asked]
    table = pd.DataFrame({"id": [*names, "latent/accuracy-ratio-task_2", "sp_resnet/fewest-params"]})
    table = pd.concat([table, pd.DataFrame({"id": ["lomp/rmse-double-lomp"]})], ignore_index=True)
    table["paper"] = table["id"].str.partition("/")[0]
    return table.assign(
        claim="LoMP is Best.", verdict="undecided", ours=float("nan"), low=0.4, high=0.6, published=0.5,
        kind="sentence", data="simulated",
    ).assign(verdict=lambda rows: rows["id"].map(lambda name: ours.get(name, "undecided")))  # fmt: skip


def of_touch(budget: str, **worse) -> one_table.Results:
    """Results of touch, three seeds of each protocol; worse: model -> its error in the last two."""
    rows = [
        ("touch", protocol, condition, model, metric, seed, budget, value)
        for protocol in ("press", "random_window")
        for condition in ("single", "double")
        for model, error in (dict.fromkeys(CONTENT_MODELS, 12.0) | ERRORS).items()
        for seed in (0, 1, 2)
        for metric, value in (
            ("rmse", worse.get(model, error) if seed else error),
            ("touches_found", 0.9 - 0.01 * error + 0.001 * seed * (model == "lomp")),
        )
    ]
    names = ["experiment", "protocol", "condition", "model", "metric", "seed", "budget", "value"]
    return one_table.Results(pd.DataFrame(rows, columns=names).reindex(columns=[*COLUMNS, one_table.WHOLE]))


CONTENT_MODELS = ("linear", "poly", "tree", "rbf", "cnn", "vgg", "rnn")


@pytest.fixture
def reported(workspace):
    for name in ("touch", "strain", "glove"):
        (workspace.reports / name).mkdir(parents=True)
    return workspace


def test_a_table_and_findings_say_the_evidence(reported):
    results = of_touch(FULL, lomp_stream=172.0, lomp=8.4)
    verdicts = {"lomp/rmse-double-lomp": "near", "lomp/lomp-best-double": "reproduced"}
    touch, strain, _ = answers.answers(reported, judged(**verdicts), results, CONTENT, VALUES)
    (row,) = (row for row in touch.table.rows if row[0] == "LoMP")
    assert row[4] == "7.49" and row[5].startswith("8.26 [") and row[6] == "near"
    assert "random windows, the paper's split; geometric means of 3 trainings [95 % intervals]." in touch.basis
    best, array, messages, shift, frames, beyond = touch.findings
    assert best.verdict == "reproduced" and "8.3 kPa" in best.text and "ConvLSTM, has 10.0 kPa" in best.text
    assert "less often than LoMP" in beyond.text and "1.7 times LoMP's error" in beyond.text
    assert array.text == "What LoMP shows of several fingers on a recorded array is not computed yet."
    assert messages.text.startswith("Not computed yet")
    assert all(one.text.endswith("is not computed yet.") for one in (shift, frames))
    assert "4 of the 6 trainings of streaming LoMP" in beyond.text, "one above the constant model is a failed one"
    assert strain.table.rows[0][1:] == ["0.43", "27.00"] and answers.NOT_COMPUTED in strain.basis
    assert "not computed yet" in strain.findings[0].text


@pytest.mark.parametrize(
    ("errors", "words"),
    [
        ({}, "so that LoMP is first on one and two and three;"),
        ({"rbf": (4.4, 8.1, 9.4), "linear_array": (5.5, 6.0, 9.0)}, "so that LoMP is first on three;"),
        ({"lomp": (9.9, 9.9, 9.9)}, "so that LoMP is first on none;"),
    ],
)
def test_the_recorded_array_stands_beside_the_simulated_numbers(reported, errors, words):
    """Errors of all folds together; the best others are of other kinds than LoMP."""
    table = pd.concat([of_touch(FULL).table, made_array.table(**errors)], ignore_index=True)
    results = one_table.Results(table.reindex(columns=[*COLUMNS, one_table.WHOLE]))
    touch, *_ = answers.answers(reported, judged(), results, CONTENT, VALUES)
    text = touch.findings[1].text
    assert words in text and "LoMP shows both contacts in 95 % of frames, the CNN in 41 %." in text
    if not errors:
        assert "of 4.8 [4.6, 4.9] % on one contact, 6.3 [6.1, 6.5] on two and 7.6 [7.3, 7.8] on three" in text
        assert "The best others have 4.9 [4.7, 5.0] (RBF-Net), 7.7 [7.4, 7.9] (Linear, whole array) and 9.3" in text
        assert "with one read-out for all elements it has 4.6, 6.2, 7.5." in text


def test_the_look_is_no_evidence(reported):
    touch, *_ = answers.answers(reported, judged(), of_touch(LOOK), CONTENT, VALUES)
    assert all(len(row) == 3 for row in touch.table.rows), "a model and what the paper prints"
    assert [one.text for one in touch.findings][0] == "Not computed yet: LoMP is Best."
    assert all("ot computed yet" in one.text for one in touch.findings)


def test_readme_says_what_the_committed_reports_give(reported):
    workspace = Workspace(ROOT)
    results = one_table.results(workspace, one_table.of_own_logs(VALUES))
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    found = answers.answers(workspace, claims.read(workspace), results, CONTENT, VALUES)
    (reported.root / "README.md").write_text(text, encoding="utf-8")
    evidence = reported.root / "evidence"
    evidence.mkdir(exist_ok=True)
    (evidence / "index.csv").write_bytes((ROOT / "evidence" / "index.csv").read_bytes())
    answers.write_readme(reported, found, claims.read(workspace))
    assert (reported.root / "README.md").read_text(encoding="utf-8") == text, "run `python -m pipeline.stages.page`"
    for one in found:  # the chart shows what has a verdict, and nothing else
        columns = [k for k, title in enumerate(one.table.header) if title == "verdict"]
        assert sum(map(len, one.points.values())) == sum(row[k] != "-" for row in one.table.rows for k in columns) > 0
    (drawn,) = (point for point in found[0].points["Two touches"] if point.model == "lomp")
    claim = claims.read(workspace).set_index("id").loc["lomp/rmse-double-lomp"]
    assert drawn[1:] == tuple(claim[["published", "ours", "low", "high"]]) and claim["unit"] == "1"
    assert len(found) == 3 and len(text.splitlines()) <= 140
    listed = (ROOT / "reports" / origins.FILE).read_text(encoding="utf-8")
    assert listed == origins.document(workspace, results), "run `python -m pipeline.stages.page`"


def test_our_numbers_are_links_to_the_shards_that_they_are_of(workspace):
    """A list of shards has a heading for every link, and names the files of these shards and no others."""
    sets = {"data": "all", "seeds": 2, "minutes": 1}
    frames = {"experiment": "glove", "protocols": ["random_frames_combined"], **sets}
    made_evidence.write_sets(workspace, {"one": frames, "two": frames | {"variant": "epochs_50"}})
    place = "glove", "random_frames_combined", "combined"
    for seed in (0, 1):
        rows = made_evidence.scores(*place, {"resnet18": 0.9, "sp_resnet": 0.8}, seed)
        made_evidence.keep(workspace, f"one-{seed}-full", rows, f"{seed}23456789abcdef", f"machine {seed}")
        rows = made_evidence.scores(*place, {"sp_resnet": 0.95}, seed, variant="epochs_50")
        made_evidence.keep(workspace, f"two-{seed}-full", rows)
    (workspace.reports / "glove").mkdir(parents=True)
    results = shown.evidence(workspace)
    (glove,) = answers.answers(workspace, judged(), results, CONTENT, VALUES)
    linked = glove.linked(lambda text, at: f"<{text} {at}>")
    rows = {row[0]: row for row in linked.rows}
    assert rows["ResNet-18"][3:5] == ["96.02", "<90.00 shards.md#glove-random_frames_combined>"]
    assert rows["SP-ResNet"][4] == "<95.00 shards.md#glove-random_frames_combined-epochs_50>"
    assert not any("<" in cell for name in ("Naive Bayes", "MobileNet") for cell in rows[name])
    assert all("<" not in cell for row in glove.table.rows for cell in row), "the page's chart has none"
    text = origins.document(workspace, results)
    _, main, long = text.split("\n### ")
    assert main.startswith("glove random_frames_combined\n") and long.startswith(
        "glove random_frames_combined epochs_50\n"
    )
    assert all(f"[{seed}](../evidence/results/one-{seed}-full.csv)" in main for seed in (0, 1)) and "two-" not in main
    assert "machine 0 or machine 1; commit 023456789abc, 123456789abc; 120 core-seconds" in main
    assert "**two, full**: SP-ResNet; seeds" in long and "one-" not in long and "; commit c0ffee;" in long


@pytest.mark.parametrize(
    ("protocol", "variant", "wanted"),
    [
        ("press", "", "shards.md#touch-press"),
        ("press", "width_0.25", "shards.md#touch-press-width_025"),
        ("session_combined", "augmentation_A", "shards.md#touch-session_combined-augmentation_a"),
    ],
)
def test_a_heading_is_addressed_as_code_hosts_do(protocol, variant, wanted):
    assert origins.place("touch", protocol, variant) == wanted


def test_readme_needs_its_markers(reported):
    path, ((start, end), (further, last)) = reported.root / "README.md", answers.BLOCKS.values()
    answers.write_readme(reported, [], judged())
    assert not path.exists(), "a workspace may have none"
    path.write_text(f"# Mine\n{start}\nold\n{end}\nkept\n{further}\nold\n{last}\nkept\n")
    answers.write_readme(reported, [], judged())
    text = path.read_text()
    assert "old" not in text and text.startswith("# Mine\n") and text.endswith(f"{last}\nkept\n")
    assert f"{end}\nkept\n{further}" in text
    for lines, wanted in ((f"{start}\n{end}\n", "answers: written by"), (f"{start}\n", "end of summary")):
        path.write_text(lines)
        with pytest.raises(InputError, match=wanted):
            answers.write_readme(reported, [], judged())


def test_the_summary_counts_every_claim_once_and_says_what_holds(reported):
    """A question is answered by the verdict of its claim, and one without numbers says so."""
    own = judged(**{"lomp/lomp-best-double": "reproduced"})
    table = pd.concat([of_touch(FULL).table, made_array.table()], ignore_index=True)
    results = one_table.Results(table.reindex(columns=[*COLUMNS, one_table.WHOLE]))
    own.loc[own["id"] == "lomp/lomp-best-double", "ours"] = 1.0
    touch, strain, _ = answers.answers(reported, own, results, CONTENT, VALUES)
    assert touch.short.startswith(
        "**Yes.** Its error on two touches is 8.0 kPa (paper 7.5), that of the next best model 10.0"
    )
    assert strain.short == "Not computed yet."
    start, end = answers.BLOCKS["summary"]
    (reported.root / "README.md").write_text("\n".join(line for at in answers.BLOCKS.values() for line in at))
    answers.write_readme(reported, [touch, strain], own)
    text = (reported.root / "README.md").read_text().partition(start)[2].partition(end)[0]
    assert (
        f"Of {len(own)} claims that count, 1 sentences are reproduced" in text
        and f"{len(own) - 1} are undecided" in text
    )


def test_a_number_that_is_off_says_on_which_side(reported):
    """LoMP's ratio is judged, so that the side is that of the ratio."""
    own = judged(**{"lomp/rmse-double-lomp": "off"})
    for ours, wanted in ((0.2, "off, lower"), (0.7, "off, higher")):
        own.loc[own["id"] == "lomp/rmse-double-lomp", "ours"] = ours
        touch, *_ = answers.answers(reported, own, of_touch(FULL), CONTENT, VALUES)
        assert next(row for row in touch.table.rows if row[0] == "LoMP")[6] == wanted
