"""Write the raw serial logs of a simulated scene, with every injected fault listed in `faults.csv`.

Where params.yaml names logs of your own as the experiment's source, the scene's folder stays empty.
Usage: python -m pipeline.stages.simulate touch|strain|glove
"""

from tqdm import tqdm

from pipeline import scenes
from tactile.base import arguments, files, params, workers
from tactile.base.paths import Workspace


def simulate(workspace: Workspace, experiment: str, settings: dict) -> None:
    """Write data/<experiment>/logs/<condition>/<recording>/<device>.log and data/<experiment>/logs/faults.csv."""
    if settings["source"] != "simulated":
        with files.replacing_folder(workspace.logs(experiment)) as draft:
            files.write_text(draft / "README.md", f"Not simulated: the logs are in {settings['source']}.\n")
        return
    recordings, logs_of = scenes.plan(experiment, settings)
    with files.replacing_folder(workspace.logs(experiment)) as draft:
        tasks = {(each.condition, each.name): (draft, each, logs_of) for each in recordings}
        folders = {(each.condition, each.name): scenes.folder_of(draft, each) for each in recordings}
        with tqdm(total=len(tasks), desc=f"simulate {experiment}", unit="recording") as bar:
            faults = dict(workers.run(scenes.write_recording, tasks, bar, folders=folders))
        rows = [row for key in tasks for row in faults[key]]
        files.write_csv(draft / "faults.csv", ["condition", "recording", "file", "line", "fault"], rows)


def main(workspace: Workspace) -> None:
    """Simulate the experiment named on the command line."""
    experiment = arguments.parse(__doc__, experiment=scenes.NAMES).experiment
    simulate(workspace, experiment, params.load(workspace.params)[experiment])


if __name__ == "__main__":
    arguments.run(main)
