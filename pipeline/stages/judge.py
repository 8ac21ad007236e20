"""Judge every claim of the three papers, or those that the data of one experiment can tell.

Writes reports/claims.csv, one row per claim in full precision; reports/claims_by_scale.csv, the same with the verdicts
of the run at the papers' scale (reports/paper_scale), which are shown first; and reports/claims.md, which says that to
people and, for each claim that is not reproduced, what was tried to find the reason. Of recordings that are absent the
committed verdicts stay.
Usage: python -m pipeline.stages.judge [EXPERIMENT]
"""

import re
from collections.abc import Collection

import pandas as pd

from pipeline.base import arguments, files, params, paths
from pipeline.base.availability import why_not_run
from pipeline.base.errors import run_stage
from pipeline.reporting.claims import (
    RECORDED,
    all_claims,
    by_scale,
    experiment_of,
    on_own_logs,
    read_paper_scale,
    rows,
    text,
)
from pipeline.reporting.verdicts.rules import EXPERIMENTS, RECORDED_EXPERIMENTS, VERDICTS, Evidence
from pipeline.scoring.kept import kept_rows


def with_kept(judged: pd.DataFrame, absent: Collection[str]) -> tuple[pd.DataFrame, dict[str, str]]:
    """Return claims.csv with the committed rows of the claims `absent`, and what was tried for them, by their ids.

    judged: claims.csv as it comes out here.
    """
    kept = kept_rows(paths.REPORTS / "claims.csv", absent, by="id")
    if kept.empty or list(kept) != list(judged):
        return judged, {}
    for name in judged.select_dtypes(exclude="number"):
        kept[name] = kept[name].astype(object).where(kept[name].notna(), "")
    new = judged[~judged["id"].isin(kept["id"])]
    together = pd.concat([new, kept.astype(new.dtypes)]).set_index("id").loc[judged["id"]].reset_index()
    committed, heads, tried = paths.REPORTS / "claims.md", [], {}
    for line in committed.read_text(encoding="utf-8").splitlines() if committed.is_file() else []:
        if found := re.match(r"- \*\*(.*)\*\* \[recorded\] ", line):
            heads.append(found[1])
        elif line and not line.startswith("- "):
            tried |= dict.fromkeys(heads, line)
            heads = []
    names = kept.set_index(kept["claim"].str.rstrip("."))["id"]
    return together, {names[head]: line for head, line in tried.items() if head in names}


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
    absent = {claim.id for claim in claims if claim.data == RECORDED and why_not_run(experiment_of(claim, values))}
    judged, tried = with_kept(judged, absent)
    shown = by_scale(judged, judged.iloc[:0] if chosen else read_paper_scale())
    files.write_table(paths.REPORTS / "claims.csv", judged)
    files.write_table(paths.REPORTS / "claims_by_scale.csv", shown)
    by_id = {claim.id: claim for claim in claims}
    files.write_text(
        paths.REPORTS / "claims.md", text(shown, lambda name: tried.get(name) or by_id[name].explained(evidence))
    )
    words = list(shown["verdict"])
    print(f"{len(words)} claims: {', '.join(f'{words.count(word)} {word}' for word in VERDICTS)}")


if __name__ == "__main__":
    run_stage(main)
