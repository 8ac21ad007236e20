"""Move modules of pipeline/ into rooms and rewrite imports and uses. Run in the root of a checkout."""
import ast, re, subprocess, sys
from pathlib import Path

MOVES = {
 # base
 **{n: f"base.{n}" for n in ("errors", "workers", "cluster", "paths", "files", "params", "blocks", "availability")},
 "parent": "base.processes", "runs": "base.runs",
 # logs
 "logs": "logs.parse", "alignment": "logs.clocks", "mistakes": "logs.diagnosis", "matlab": "logs.matlab", "sources": "logs.sources", "stag": "logs.stag", "own": "logs.own_files",
 # datasets
 "tables": "datasets.schemas", "windowing": "datasets.windowing", "series": "datasets.series", "images": "datasets.images", "labels": "datasets.labels", "seeding": "datasets.seeding",
 # learning
 "training": "learning.training", "fitting": "learning.regressors", "series_fitting": "learning.series_regressors", "image_fitting": "learning.image_classifier",
 "message_passing": "learning.lomp_network", "residual": "learning.residual_blocks", "counting": "learning.cost", "trained": "learning.trained",
 # scoring
 "metrics": "scoring.metrics", "classification": "scoring.objects", "results": "scoring.results", "ladders": "scoring.ladders", "variants": "scoring.variants",
 # stability
 "perturbations": "stability.perturbations", "stress_windows": "stability.windows", "stress_series": "stability.series", "stress_images": "stability.images", "clean_scores": "stability.clean_scores",
 # studies
 "rightsize": "studies.sizes", "narrow": "studies.narrow_sp_resnet", "physics": "studies.physics", "study": "studies.latent", "augment": "studies.augmentation", "probe": "studies.joint_angles", "train_stag": "studies.stag", "count": "studies.counts", "operations": "studies.operations",
 # commands
 **{n: f"commands.{n}" for n in ("fetch", "record", "check", "fit_material", "scale")},
 # stages
 **{n: f"stages.{n}" for n in ("settings","simulate", "ingest", "window", "dataset", "train", "train_series", "train_images", "evaluate", "latency", "stress", "collect", "render", "render_stability", "render_physics", "render_rightsize", "judge", "page", "agreement", "track")},
 # reporting
 "pages": "reporting.experiment", "pages_touch": "reporting.touch_pages", "pages_glove": "reporting.glove_pages", "pages_strain": "reporting.strain_pages",
 "report_touch": "reporting.touch", "report_velostat": "reporting.velostat_recorded", "report_strain": "reporting.strain", "report_strain_recorded": "reporting.strain_recorded",
 "report_glove": "reporting.glove", "report_glove_recorded": "reporting.glove_recorded", "report_glove_findings": "reporting.glove_findings",
 "report_speed": "reporting.speed", "report_stability": "reporting.stability", "report_physics": "reporting.physics",
 "markdown": "reporting.markdown", "sentences": "reporting.sentences", "differences": "reporting.differences",
 "figures": "reporting.figures.style", **{f"figures_{n}": f"reporting.figures.{n}" for n in ("check", "glove", "physics", "rightsize", "speed", "stability", "strain", "touch", "velostat")},
 "claims": "reporting.verdicts.rules", "claims_touch": "reporting.verdicts.touch", "claims_strain": "reporting.verdicts.strain", "claims_glove": "reporting.verdicts.glove",
 "effects": "reporting.verdicts.physics", "enough": "reporting.verdicts.sizes",
 "page_charts": "reporting.page.charts", "hypertext": "reporting.page.html",
}
LOCAL = {  # what a module is called where it is imported, if not by its last name
}

def local(new): return LOCAL.get(new, new.rsplit(".", 1)[1])

def scopes_with(tree, name):
    """Nodes of functions in which `name` is bound locally."""
    found = []
    for node in ast.walk(tree):
        if isinstance(node, (ast.FunctionDef, ast.Lambda)):
            a = node.args
            names = {x.arg for x in [*a.args, *a.kwonlyargs, *a.posonlyargs] + [y for y in (a.vararg, a.kwarg) if y]}
            body = node.body if isinstance(node.body, list) else [node.body]
            for sub in body:
                for n in ast.walk(sub):
                    if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Store): names.add(n.id)
            if name in names: found.append(node)
        elif isinstance(node, (ast.ListComp, ast.SetComp, ast.GeneratorExp, ast.DictComp)):
            names = {n.id for g in node.generators for n in ast.walk(g.target) if isinstance(n, ast.Name)}
            if name in names: found.append(node)
    return found

def rewrite(path, text):
    tree = ast.parse(text)
    lines = text.encode().split(b"\n")
    edits = []  # (line, col, endline, endcol, new)
    renames, warnings = {}, []
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module == "pipeline":
            groups = {}
            for alias in node.names:
                if alias.name in MOVES:
                    new = MOVES[alias.name]
                    room, leaf = new.rsplit(".", 1)
                    asname = alias.asname or (None if local(new) == leaf else local(new))
                    groups.setdefault(f"pipeline.{room}", []).append(leaf + (f" as {asname}" if asname else ""))
                    if alias.asname is None and alias.name != local(new): renames[alias.name] = local(new)
                else:
                    groups.setdefault("pipeline", []).append(alias.name + (f" as {alias.asname}" if alias.asname else ""))
            indent = " " * node.col_offset
            new_text = f"\n{indent}".join(f"from {m} import {', '.join(sorted(n))}" for m, n in sorted(groups.items()))
            edits.append((node.lineno, node.col_offset, node.end_lineno, node.end_col_offset, new_text))
        elif isinstance(node, ast.ImportFrom) and node.module and node.module.startswith("pipeline."):
            old = node.module.split(".")[1]
            if node.module.count(".") == 1 and old in MOVES:
                seg = lines[node.lineno - 1].decode()
                start = seg.index(node.module, node.col_offset)
                edits.append((node.lineno, start, node.lineno, start + len(node.module), f"pipeline.{MOVES[old]}"))
        elif isinstance(node, ast.Import):
            for alias in node.names:
                if alias.name.startswith("pipeline."): warnings.append(f"{path}:{node.lineno} import {alias.name}")
    for old, new in renames.items():
        shadow = scopes_with(tree, old)
        inside = {id(n) for s in shadow for n in ast.walk(s)}
        taken = scopes_with(tree, new)
        taken_inside = {id(n): s for s in taken for n in ast.walk(s)}
        for node in ast.walk(tree):
            if isinstance(node, ast.Name) and node.id == old and id(node) not in inside:
                if isinstance(node.ctx, ast.Store): continue
                if id(node) in taken_inside: warnings.append(f"{path}:{node.lineno} {old}->{new} is taken by a local name")
                edits.append((node.lineno, node.col_offset, node.lineno, node.end_col_offset, new))
        if shadow: warnings.append(f"{path}: {old} is a local name in lines {[getattr(s,'lineno',0) for s in shadow]}")
    for l1, c1, l2, c2, new in sorted(set(edits), reverse=True):
        first, last = lines[l1 - 1], lines[l2 - 1]
        merged = first[:c1] + new.encode() + last[c2:]
        lines[l1 - 1 : l2] = merged.split(b"\n")
    out = b"\n".join(lines).decode()
    # texts: commands, paths, module names
    def dotted(m):
        return f"pipeline.{MOVES[m.group(1)]}" if m.group(1) in MOVES else m.group(0)
    out = re.sub(r"(?<=python -m )pipeline\.(\w+)", dotted, out)
    out = re.sub(r"pipeline/(\w+)\.(py|css|js|csv|sha256)", lambda m: f"pipeline/{MOVES[m.group(1)].replace('.', '/')}.{m.group(2)}" if m.group(1) in MOVES else m.group(0), out)
    return out, warnings

def main():
    root = Path(".")
    files = [Path(p) for p in subprocess.run(["git", "ls-files"], capture_output=True, text=True).stdout.split()]
    every = []
    for p in files:
        if p.suffix == ".py":
            text = p.read_text()
            new, warn = rewrite(p, text)
            every += warn
            if new != text: p.write_text(new)
        elif p.suffix in (".yaml", ".md", ".toml") and p.parts[0] not in ("reports",):
            text = p.read_text()
            new = re.sub(r"(?<=python -m )pipeline\.(\w+)", lambda m: f"pipeline.{MOVES[m.group(1)]}" if m.group(1) in MOVES else m.group(0), text)
            new = re.sub(r"pipeline/(\w+)\.(py|css|js|csv|sha256)", lambda m: f"pipeline/{MOVES[m.group(1)].replace('.', '/')}.{m.group(2)}" if m.group(1) in MOVES else m.group(0), new)
            if new != text: p.write_text(new)
    for old, new in MOVES.items():
        src = Path("pipeline") / f"{old}.py"
        if not src.exists(): print("absent", src); continue
        dst = Path("pipeline") / (new.replace(".", "/") + ".py")
        dst.parent.mkdir(parents=True, exist_ok=True)
        init = dst.parent / "__init__.py"
        subprocess.run(["git", "mv", str(src), str(dst)], check=True)
    print("\n".join(every))

main()
