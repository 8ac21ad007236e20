"""Judge every claim of the three papers, or those that the data of one experiment can tell.

Writes reports/claims.csv, one row per claim in full precision, and reports/claims.md, which says the same to people
and, for each claim that is not reproduced, what was tried to find the reason.
Usage: python -m pipeline.stages.judge [EXPERIMENT]
"""

from pipeline.base import arguments, files, params, paths
from pipeline.base.errors import run_stage
from pipeline.reporting.claims import VERDICTS, all_claims, on_own_logs, rows, text
from pipeline.reporting.verdicts.rules import EXPERIMENTS, Evidence


def main() -> None:
    """Judge the claims by the files that the stages wrote; of one experiment, what was not run is not testable."""
    chosen = arguments.parse(__doc__, experiment=(*EXPERIMENTS.values(), None)).experiment
    values = params.load()
    evidence = Evidence(values, partial=bool(chosen))
    claims = [on_own_logs(claim, values) for claim in all_claims()]
    if chosen:
        claims = [claim for claim in claims if EXPERIMENTS[claim.paper] == chosen and claim.data == "simulated"]
    verdicts = [(claim, claim.judged(evidence)) for claim in claims]
    files.write_table(paths.REPORTS / "claims.csv", rows(verdicts))
    files.write_text(paths.REPORTS / "claims.md", text(verdicts, evidence))
    words = [judged.verdict for _, judged in verdicts]
    print(f"{len(words)} claims: {', '.join(f'{words.count(word)} {word}' for word in VERDICTS)}")


if __name__ == "__main__":
    run_stage(main)
