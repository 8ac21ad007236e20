"""Judge every claim of the three papers by the files of reports, or those on one experiment by what its stages wrote.

Writes reports/claims.csv, one row per claim in full precision; reports/claims_by_scale.csv, the same with the verdicts
of the run at the papers' scale (reports/paper_scale), which are shown first; and reports/claims.md, which says that to
people and, for each claim that is not reproduced, what was tried to find the reason. Claims on recordings that are
absent are judged by the committed scores, which `collect` keeps.
Usage: python -m pipeline.stages.judge [EXPERIMENT]
"""

from pipeline.base import arguments, files, params, paths
from pipeline.base.paths import Workspace
from pipeline.claims import entries, evidence, judge
from pipeline.claims.rules import VERDICTS
from pipeline.reporting.claims import by_scale, read_paper_scale, text
from pipeline.scoring import one_table

NEEDED = ("scores", "latency", "counts", "claim_inputs")  # without an experiment; the results of studies may be missing


def main(workspace: Workspace) -> None:
    """Judge the claims; what was not run is not testable."""
    values = params.load(workspace.params)
    claims, papers = entries.read(workspace)
    experiments = [name for paper in papers.values() for name in (paper.simulated, paper.recorded)]
    chosen = arguments.parse(__doc__, experiment=(*experiments, None)).experiment
    sources = one_table.of_experiment(workspace, chosen) if chosen else one_table.of_reports(workspace.reports)
    for name in () if chosen else NEEDED:
        paths.require(sources[name], "dvc repro")
    claims = [judge.on_own_logs(claim, values) for claim in claims if chosen in (None, claim.experiment)]
    known = evidence.Evidence(workspace, one_table.read(sources), values, evidence.trainings(workspace.reports))
    judged = judge.table(claims, known)
    shown = by_scale(judged, judged.iloc[:0] if chosen else read_paper_scale(workspace))
    files.write_table(workspace.reports / "claims.csv", judged)
    files.write_table(workspace.reports / "claims_by_scale.csv", shown)
    files.write_text(
        workspace.reports / "claims.md", text(workspace, shown, {claim.id: claim.tried for claim in claims})
    )
    words = list(shown["verdict"])
    print(f"{len(words)} claims: {', '.join(f'{words.count(word)} {word}' for word in VERDICTS)}")


if __name__ == "__main__":
    arguments.run(main)
