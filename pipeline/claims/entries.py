"""Read the claims of the papers: claims/*.yaml, one entry per sentence or printed number that can be true or false.

A file names its paper and where the results of its claims are: on simulated data, on recorded data, and on further
recordings, each by a name of its own, all of which count as recorded data. An entry has

    id, text, source   its name, the sentence in our words, and where the paper says it
    <rule>             one of `rules.RULES` with an expression (`expressions`), or name -> expression where several
                       values are judged together; or `untestable` with the reason; further keys are the rule's options
    each               axis -> values: the expression once for each combination of different ones, judged together
    name               what each of these is called in a reason
    published          the published value, where it is not the same expression over the paper's own tables
    data, kind, unit, protocol, metric   where they are not those of the file; data: simulated, recorded or the name
                       of further recordings; of several protocols, which test on different persons, one result;
                       kind: `by construction` where the scene was built so, `beyond` where the paper does not claim it,
                       `another split` where the number is judged on one already
    control            what a sentence must not come out with, see below
    over               what the interval is over, where that is not seeds
    tried              what was tried to find the reason, where the claim is not reproduced

Every sentence that is judged has a control that should fail it: what passes with its control, too, tells nothing. It is
model -> another, which takes its place in results without a variant, or the name of what is tried -> the value that the
sentence would have with it, an expression, or several as of a rule. Which one:

    one of two models is better    what reads no sensor, the constant map or chance, in place of the better one; where a
                                   network is said to suffer, which what reads no sensor never does, in place of it
    one model alone is judged, or  the simplest model that reads the sensor, linear regression or raw readings, in its
    no difference is claimed       place, as nothing in the sentence is worse than it
    a cause is claimed             a model without it, such as one without convolutions or messages, or a variant that
                                   is said not to have the effect
    one model on the same data     what reads no sensor has one error in both, so that nothing could pass: the value by
    with two settings              arithmetic, a difference of 0 or a ratio of 1

A family is `for` (axis -> values) and `claims`: its entries once for every combination. In every text `{axis}` is the
value, `{axis.name}` its name; `{published}` is the published value. A value of an axis may have further words.
"""

import inspect
import itertools
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import TypeAlias

import numpy as np
import yaml

from pipeline.claims.expressions import Result, evaluate
from pipeline.claims.rules import RULES
from pipeline.results import published
from tactile.base.errors import InputError
from tactile.base.paths import Workspace

FOLDER = Path(__file__).parent
SENTENCE, NUMBER, COUNT = "sentence", "number", "count"  # kinds of claims; the first two are counted
BESIDE = "another split"  # kind: a number on another split than the one that its claim is judged on
BEYOND = "beyond"  # kind: what the paper does not claim, a finding of ours beside it
CONSTRUCTION, CALIBRATION = "by construction", "calibration"
KINDS = {"near": NUMBER, "timed": NUMBER, "equal": COUNT, "fewer": COUNT, "calibrated": CALIBRATION}  # by rule
ALL_KINDS = (SENTENCE, NUMBER, COUNT, CONSTRUCTION, CALIBRATION, BESIDE, BEYOND)
UNTESTABLE = "untestable"
KEYS = {"id", "text", "source", "each", "name", "published", "data", "kind", "unit", "protocol", "metric"}
KEYS |= {"over", "tried", "control"}
SIMULATED, RECORDED = "simulated", "recorded"  # data
HEAD = {"paper", "title", "names", SIMULATED, RECORDED, "further", "claims", "lists"}


Given: TypeAlias = str | Sequence[str] | Mapping[str, str]  # protocol: a name, several, or condition -> name
Named: TypeAlias = str | tuple[str, ...] | Mapping[str, str]  # the same with the words of a family


class Word(str):
    """A value of an axis; `name` and further attributes are its words in sentences."""

    name: str


@dataclass(frozen=True)
class Source:
    """Where the results of a paper's claims are, on one kind of data."""

    experiment: str
    metric: str
    unit: str
    protocol: Given  # several are one result
    printed: str = ""  # the metric that the paper prints in place of it
    conditions: Mapping[str, str] = field(default_factory=dict)  # condition -> the paper's, where it is another word
    splits: Mapping[str, Sequence[str]] = field(
        default_factory=dict
    )  # in place of a variant -> the protocols it stands for


@dataclass(frozen=True)
class Control:
    """What a claim must not come out with: other models, or other values."""

    name: str  # in sentences
    models: Mapping[str, str] = field(default_factory=dict)  # model -> the one in its place
    values: Mapping[str, str] = field(default_factory=dict)  # name -> expression, in place of the claim's


@dataclass(frozen=True)
class Claim:
    """One sentence of a paper that can be true or false of our numbers, and how it is judged."""

    id: str
    paper: str
    text: str
    section: str
    data: str  # SIMULATED or RECORDED
    kind: str
    unit: str
    experiment: str
    rule: str
    values: Mapping[str, str]  # name -> expression
    options: Mapping[str, object]
    metric: str
    protocol: Named  # as of Source
    splits: Mapping[str, Sequence[str]]  # as of Source
    published: float
    printed: Mapping[str, float]  # of each of `values`
    names: Mapping[str, str]  # of models and conditions, in sentences
    over: str = "seeds"
    reason: str = ""  # of an untestable claim
    tried: str = ""
    control: Control | None = None


@dataclass(frozen=True)
class Paper:
    """What a file says of its paper."""

    key: str
    title: str
    sources: Mapping[str, Source]  # SIMULATED, RECORDED, and further recordings by name

    @property
    def simulated(self) -> str:
        """Return the simulated experiment."""
        return self.sources[SIMULATED].experiment

    @property
    def recorded(self) -> list[str]:
        """Return the recorded experiments."""
        return [source.experiment for name, source in self.sources.items() if name != SIMULATED]


def files(workspace: Workspace) -> list[Path]:
    """Return the files of claims: the papers', and those of the workspace, claims/*.yaml."""
    return [
        *(FOLDER / f"{paper}.yaml" for paper in published.PRINTED),
        *sorted((workspace.root / "claims").glob("*.yaml")),
    ]


def read(workspace: Workspace, sources: Sequence[Path] | None = None) -> tuple[list[Claim], dict[str, Paper]]:
    """Return all claims, in the order of their files, and paper -> what is said of it.

    A later file of the same paper adds to its claims, and need not say again what the first one says. Raises InputError
    that names the file and the claim for an entry that cannot be read.
    """
    heads: dict[str, dict] = {}
    claims: dict[str, Claim] = {}
    papers: dict[str, Paper] = {}
    for path in files(workspace) if sources is None else sources:
        try:
            content = _parsed(path.read_text(encoding="utf-8"))
            if unknown := set(content) - HEAD:
                raise InputError(f"key '{sorted(unknown)[0]}' is unknown")
            head = heads.setdefault(content["paper"], {})
            head |= {key: value for key, value in content.items() if key != "claims"}
            given = {SIMULATED: head[SIMULATED], RECORDED: head[RECORDED]} | head.get("further", {})
            by_data = {name: Source(**source) for name, source in given.items()}
            papers[content["paper"]] = Paper(content["paper"], head["title"], by_data)
            for claim in _claims(head, by_data, content["claims"]):
                if claim.id in claims:
                    raise InputError(f"claim {claim.id}: stands there twice")
                claims[claim.id] = claim
        except (InputError, yaml.YAMLError, TypeError, AttributeError) as error:
            raise InputError(f"{path}: {error}; see pipeline/claims/entries.py") from error
        except KeyError as error:
            raise InputError(f"{path}: key {error} is missing") from error
    return list(claims.values()), papers


def papers(workspace: Workspace) -> dict[str, Paper]:
    """Return paper -> what is said of it."""
    return read(workspace)[1]


@cache
def _parsed(text: str) -> dict:
    return yaml.safe_load(text)


def _claims(head: Mapping, sources: Mapping[str, Source], entries: Sequence[Mapping]) -> Iterator[Claim]:
    """Yield the claims of a file; head: its other keys; sources: by data."""
    names, table = head.get("names", {}), published.table(head["paper"]).set_index(list(Result._fields))
    printed = {column: dict(zip(map(Result._make, table.index), table[column], strict=True)) for column in table}
    for entry in entries:
        family: Mapping = entry if "for" in entry else {"for": {}, "claims": [entry]}
        for words in _combinations(family["for"], names):
            for one in family["claims"]:
                try:
                    yield _claim(head, sources, one, words, names, printed)
                except KeyError as error:
                    problem = f"{error} is neither a key of the entry nor an axis of its family"
                    raise InputError(f"claim {one.get('id', one)}: {problem}") from error
                except (InputError, TypeError, ValueError, AttributeError) as error:
                    raise InputError(f"claim {one.get('id', one)}: {error}") from error


def _combinations(axes: Mapping[str, Iterable], names: Mapping[str, str]) -> Iterator[dict[str, object]]:
    """Yield axis -> value, for every combination of different values; names: value -> what it is called."""
    listed = [[_word(value, words, names) for value, words in _pairs(values)] for values in axes.values()]
    for chosen in itertools.product(*listed):
        if len(set(chosen)) == len(chosen):
            yield dict(zip(axes, chosen, strict=True))


def _pairs(values: Iterable) -> Iterator[tuple[object, object]]:
    yield from values.items() if isinstance(values, Mapping) else ((value, None) for value in values)


def _word(value: object, words: object, names: Mapping[str, str]) -> object:
    if not isinstance(value, str):
        return value
    word = Word(value)
    word.name = words if isinstance(words, str) else names.get(value, value.replace("_", " "))
    vars(word).update(words if isinstance(words, Mapping) else {})
    return word


def _claim(
    head: Mapping,
    sources: Mapping[str, Source],
    entry: Mapping,
    words: Mapping,
    names: Mapping[str, str],
    printed: Mapping,
) -> Claim:
    """Return the claim of an entry; words: axis of its family -> value; printed: the paper's tables, see `_claims`."""
    rules = [key for key in entry if key in RULES or key == UNTESTABLE]
    if len(rules) != 1:
        raise InputError(f"give one of the rules {', '.join(RULES)}, {UNTESTABLE}; found {', '.join(rules) or 'none'}")
    (rule,) = rules
    taken = dict(list(inspect.signature(RULES[rule]).parameters.items())[2:]) if rule in RULES else {}
    options = {
        key: _filled(entry[key], words) if isinstance(entry[key], str) else entry[key] for key in entry if key in taken
    }
    needed = [key for key, option in taken.items() if option.default is option.empty and key not in (*options, "step")]
    if needed:
        raise InputError(f"the rule `{rule}` needs '{needed[0]}'")
    kind = entry.get("kind", KINDS.get(rule, SENTENCE))
    if kind not in ALL_KINDS:
        raise InputError(f"kind '{kind}' is none of {', '.join(ALL_KINDS)}")
    if unknown := set(entry) - KEYS - {rule, *taken}:
        raise InputError(f"key '{sorted(unknown)[0]}' is unknown to the rule `{rule}`")
    given = entry.get("data", SIMULATED).format_map(words)
    source, data = sources[given], SIMULATED if given == SIMULATED else RECORDED
    if kind == SENTENCE and rule in RULES and rule != "timed" and "control" not in entry:
        raise InputError("a sentence needs a 'control', with which it must not come out")
    metric = entry.get("metric", source.metric)

    def paper_says(expression: str, column: str = "value") -> float:
        def look_up(result: Result) -> float:
            condition = source.conditions.get(result.condition, result.condition)
            result = result._replace(condition=condition, metric=result.metric or source.printed or metric)
            return printed[column].get(result, np.nan)

        return float(evaluate(expression, look_up))

    expressions = {} if rule == UNTESTABLE else dict(_expressions(entry, entry[rule], words, names))
    on_paper = {name: paper_says(expression) for name, expression in expressions.items()}
    given = entry.get("published")
    if given is None:  # several directions: the weakest; an order has no number
        weakest = np.max if rule == "below" else np.min
        value = np.nan if rule in ("order", UNTESTABLE) else float(weakest(list(on_paper.values())))
    else:
        value = paper_says(given.format_map(words)) if isinstance(given, str) else float(given)
        on_paper = dict.fromkeys(on_paper, value)
    if rule == "equal":
        step_of = given if isinstance(given, str) else next(iter(expressions.values()))
        options["step"] = paper_says(step_of.format_map(words), "step")
    said = {**words, "published": value}
    text = {key: entry[key].format_map(said) for key in ("id", "text", "source")}
    return Claim(
        id=f"{head['paper']}/{text['id']}" + (f"/{RECORDED}" if data == RECORDED else ""),
        paper=head["paper"],
        text=text["text"],
        section=text["source"],
        data=data,
        kind=kind,
        unit=entry.get("unit", source.unit),
        experiment=source.experiment,
        rule=rule,
        values=expressions,
        options=options,
        metric=metric,
        protocol=_filled(entry.get("protocol", source.protocol), words),
        splits=source.splits,
        published=value,
        printed=on_paper,
        names=names,
        over=entry.get("over", "seeds"),
        reason=entry[rule].format_map(words) if rule == UNTESTABLE else "",
        tried=entry.get("tried", "").format_map(said),
        control=_control(entry, words, names, expressions, source) if "control" in entry else None,
    )


def _control(
    entry: Mapping, words: Mapping, names: Mapping[str, str], expressions: Mapping[str, str], source: Source
) -> Control:
    """Return the control of an entry; expressions: of the claim. Raises InputError for one that changes nothing."""
    given = {one.format_map(words): other for one, other in entry["control"].items()}
    read: set[str] = set()

    def note(result: Result) -> np.float64:
        read.update({result.model} if result.variant in ("", *source.splits) else ())
        return np.float64(np.nan)

    if not all(isinstance(other, str) and other.isidentifier() for other in given.values()):
        if len(given) > 1:
            raise InputError("a control is model -> another, or one name -> a value or expressions")
        ((name, rule),) = given.items()
        values = dict(_expressions(entry, rule if isinstance(rule, Mapping) else str(rule), words, names))
        for expression in values.values():
            evaluate(expression, note)
        return Control(name, values=values)
    for expression in expressions.values():
        evaluate(expression, note)
    if idle := sorted(set(given) - read):
        raise InputError(f"its control changes nothing: no result of '{idle[0]}' without a variant is in the claim")
    new, old = (list(dict.fromkeys(names.get(model, model) for model in side)) for side in (given.values(), given))
    return Control(f"{_listed(new)} in place of {_listed(old)}", given)


def _listed(words: Sequence[str]) -> str:
    """Return `a`, `a and b` or `a, b and c`."""
    return " and ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else words)


def _expressions(
    entry: Mapping, rule: str | Mapping[str, str], words: Mapping, names: Mapping
) -> Iterator[tuple[str, str]]:
    """Yield the name and the expression of every value of an entry."""
    for chosen in _combinations(entry.get("each", {}), names):
        said = {**words, **chosen}
        if isinstance(rule, Mapping):
            yield from ((name.format_map(said), text.format_map(said)) for name, text in rule.items())
        else:
            named = " ".join(str(getattr(value, "name", value)) for value in chosen.values())
            yield entry.get("name", named).format_map(said), rule.format_map(said)


def _filled(protocol: Given, words: Mapping) -> Named:
    """Return a protocol with the words of its family, but for `{condition}`, which is that of each result."""
    kept = {**words, "condition": "{condition}"}
    if isinstance(protocol, str):
        return protocol.format_map(kept)
    if isinstance(protocol, Sequence):
        return tuple(name.format_map(kept) for name in protocol)
    return {condition: name.format_map(kept) for condition, name in protocol.items()}
