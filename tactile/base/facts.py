"""What other rooms ask of an experiment beside its functions; the values are `FACTS` of its module."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

STARTS = "starts"  # of networks, all on one test part
FOLDS = "folds"  # of recordings: each seed tests on other units


class Source(NamedTuple):
    """The origin of public recordings: files at one pinned commit of a repository."""

    repository: str
    commit: str
    folder: str  # of the repository, in which the paths of the files start
    licence: str
    size: int  # of all files, bytes


class Paper(NamedTuple):
    """What the paper prints of its models, and what we show beside it."""

    key: str  # of published.csv
    metric: str  # of scores.csv
    printed: str  # the metric's name there
    times: int  # how many of its units are one of ours
    conditions: Mapping[str, str]  # of its table -> heading
    splits: Mapping[str, str]  # protocols of a condition -> in words; that of verdicts first, as a rule the paper's
    variants: Mapping[tuple[str, str], str] = {}  # (protocol, model) -> variant that stands for the model
    epochs: int | None = None  # of its trainings; None where it prints no number


class Twin(NamedTuple):
    """The recordings that a scene is compared with."""

    experiment: str
    title: str  # of the comparison
    scene: str = ""  # the experiment that is compared, where it is another one than has this fact
    said: str = ""  # what the numbers tell; {statistic[column]} stands for a number of reports/twins.csv


class Finding(NamedTuple):
    """What logs of people's own sensors show."""

    text: str
    wrong: bool = False  # to be mended before models are trained


class Panel(NamedTuple):
    """What one panel of the picture of a recording shows."""

    title: str
    files: str  # pattern of the logs' names, without .log
    columns: str  # pattern
    combined: Callable | None = None  # (n, columns) to one line (n,); None: a line each


@dataclass(frozen=True, kw_only=True)
class Facts:
    """The facts of one experiment."""

    label: str  # its name in headings
    unit: str  # of readings, where the settings name none
    output_unit: str  # of what its models say
    metric: str  # that models are compared by; less is better, but of accuracy
    compared: tuple[str, ...]  # protocols of which MLflow compares the first that was run
    score: str  # by which MLflow compares
    first_tested: tuple[str, str]  # protocol and condition whose stability people read first
    tested: Mapping[tuple[str, str], str] = field(default_factory=dict)  # (protocol, condition) of stress, in words
    drawn: tuple[str, ...] = ()  # protocols whose predictions figures of the reports show
    seeds: str = STARTS  # what each seed has another one of, in the plural
    sheet: str  # the function of tactile/sheet/sources.py that makes its sensors for the data sheet
    pooled: tuple[str, ...] = ()  # name of all test windows of a run together
    stream: bool = True  # frames follow one another; else there is neither a data sheet nor a prediction of a log
    subject: str = ""  # column of the dataset: of whom a row is, who is drawn anew before what is of one
    twin: Twin | None = None  # of a scene, or of further recordings that a scene is compared with
    # Of sensors that people record themselves.
    log: str | None = None  # the sensor's log in the folder of a recording
    truth: tuple[str, ...] = ()  # logs beside it
    layout: tuple[str, ...] = ()  # settings that say how logs are printed, and not what printed them
    sensor: tuple[str, ...] = ()  # settings that say what printed them
    panels: tuple[Panel, ...] = ()  # of a picture of its logs; none: one for each area
    quick: tuple[str, ...] = ()  # models of `tactile try`: one that knows nothing, quick ones, a network of the papers
    # Of simulated sensors.
    paper: Paper | None = None
    first: str = ""  # name of its recordings of the first specimen, where names do not number specimens
    purpose: Mapping[str, str] = field(default_factory=dict)  # effect that no model has to see -> what it is for
    shown: Mapping[str, str] = field(default_factory=dict)  # effect that recordings show -> statistic of the twins
    # Of public recordings.
    source: Source | None = None
    targets: Mapping[str, int | None] = field(default_factory=dict)  # free target -> column of y_mm; None: the object
