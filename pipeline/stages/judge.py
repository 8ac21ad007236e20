"""Judge every claim of the three papers, or those that the data of one experiment can tell.

Writes reports/claims.csv, one row per claim in full precision; reports/claims_by_scale.csv, the same with the verdicts
of the run at the papers' scale (reports/paper_scale), which are shown first; and reports/claims.md, which says that to
people and, for each claim that is not reproduced, what was tried to find the reason.
Usage: python -m pipeline.stages.judge [EXPERIMENT]
"""

from pipeline.base import arguments, files, params, paths
from pipeline.base.errors import run_stage
from pipeline.reporting.claims import all_claims, by_scale, experiment_of, on_own_logs, read_paper_scale, rows, text
from pipeline.reporting.verdicts.rules import EXPERIMENTS, RECORDED_EXPERIMENTS, VERDICTS, Evidence


def main() -> None:
    """Judge the claims by the files that the stages wrote; of one experiment, what was not run is not testable."""
    known = (*EXPERIMENTS.values(), *RECORDED_EXPERIMENTS.values(), None)
    chosen = arguments.parse(__doc__, experiment=known).experiment
    values = params.load()
    evidence = Evidence(values, partial=bool(chosen))
    claims = [on_own_logs(claim, values) for claim in all_claims()]
    if chosen:
        claims = [claim for claim in claims if experiment_of(claim, values) == chosen]
    judged = rows([(claim, claim.judged(evidence)) for claim in claims], values)
    shown = by_scale(judged, judged.iloc[:0] if chosen else read_paper_scale())
    files.write_table(paths.REPORTS / "claims.csv", judged)
    files.write_table(paths.REPORTS / "claims_by_scale.csv", shown)
    by_id = {claim.id: claim for claim in claims}
    files.write_text(paths.REPORTS / "claims.md", text(shown, lambda name: by_id[name].explained(evidence)))
    words = list(shown["verdict"])
    print(f"{len(words)} claims: {', '.join(f'{words.count(word)} {word}' for word in VERDICTS)}")


if __name__ == "__main__":
    run_stage(main)
