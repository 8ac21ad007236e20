"""Judge every claim of the three papers by the files of reports.

Writes reports/claims.csv, one row per claim in full precision, and reports/claims.md, which says that to people and,
for each claim that is not reproduced, what was tried to find the reason. Judged is the evidence; of what no training
changes, the files of reports.
Usage: python -m pipeline.stages.judge
"""

from pipeline.base import arguments, files, params, paths
from pipeline.base.paths import Workspace
from pipeline.claims import entries, judge
from pipeline.claims.rules import VERDICTS
from pipeline.reporting.claims import text
from pipeline.scoring import one_table

NEEDED = ("latency", "counts")  # the results of studies may be missing


def main(workspace: Workspace) -> None:
    """Judge the claims; what was not run is open."""
    values = params.load(workspace.params)
    arguments.parse(__doc__)
    claims, _ = entries.read(workspace)
    for name in NEEDED:
        paths.require(one_table.of_reports(workspace.reports)[name], "dvc repro")
    claims = [judge.on_own_logs(claim, values) for claim in claims]
    judged = judge.table(claims, one_table.results(workspace, one_table.of_own_logs(values)))
    files.write_table(workspace.reports / "claims.csv", judged)
    tried = {claim.id: claim.tried for claim in claims}
    files.write_text(workspace.reports / "claims.md", text(workspace, judged, tried))
    words = list(judged["verdict"])
    print(f"{len(words)} claims: {', '.join(f'{words.count(word)} {word}' for word in VERDICTS)}")


if __name__ == "__main__":
    arguments.run(main)
