"""Judge every claim of the three papers by the evidence and by what is counted.

Writes reports/claims.csv, one row per claim in full precision, and reports/claims.md, which says that to people and,
for each claim that is not reproduced, what was tried to find the reason. What this machine computed is not judged.
Usage: python -m pipeline.stages.judge
"""

from pipeline.claims import entries, judge
from pipeline.claims.rules import VERDICTS
from pipeline.reporting.claims import text
from pipeline.results import one_table
from tactile.base import arguments, files, params
from tactile.base.paths import Workspace


def main(workspace: Workspace) -> None:
    """Judge the claims; what was not run is open."""
    values = params.load(workspace.params)
    arguments.parse(__doc__)
    claims, _ = entries.read(workspace)
    claims = [judge.on_own_logs(claim, values) for claim in claims]
    judged = judge.weighed(judge.table(claims, one_table.results(workspace, one_table.of_own_logs(values))))
    files.write_table(workspace.reports / "claims.csv", judged)
    tried = {claim.id: claim.tried for claim in claims}
    files.write_text(workspace.reports / "claims.md", text(workspace, judged, tried))
    words = list(judged["verdict"])
    print(f"{len(words)} claims: {', '.join(f'{words.count(word)} {word}' for word in VERDICTS)}")


if __name__ == "__main__":
    arguments.run(main)
