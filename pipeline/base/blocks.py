"""Define the blocks of params.yaml: one pydantic model per block, and the kinds that annotate a model's `build`.

The limits keep a typing error from asking for more memory or time than a machine has; each limit is at least ten times
the largest value of any setting here.
"""

from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, create_model, model_validator


class Block(BaseModel):
    """A block of settings: every key known, none missing, no value of another kind, no NaN."""

    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False, frozen=True)


def block(*bases: type[Block], **kinds: Any) -> type[Block]:
    """Return a block of these settings; bases: blocks whose settings and rules the block has, too.

    A pair (kind, default) is a setting that may be absent.
    """
    fields = {name: kind if isinstance(kind, tuple) else (kind, ...) for name, kind in kinds.items()}
    return create_model("Block", __base__=bases or Block, **fields)


class SomeOf(Block):
    """A block that has one of its settings or more."""

    @model_validator(mode="after")
    def _any(self) -> "SomeOf":
        if not self.model_fields_set:
            raise ValueError(f"should have one of these keys or more: {', '.join(type(self).model_fields)}")
        return self


def some_of(**kinds: Any) -> type[Block]:
    """Return a block of which some settings may be absent: protocols, of which an experiment can be run with some."""
    return create_model("Block", __base__=SomeOf, **{name: (kind, None) for name, kind in kinds.items()})


def whole(low: int, high: int = 1_000_000) -> Any:
    """Return the kind of whole numbers from `low` to `high`."""
    return Annotated[int, Field(ge=low, le=high)]


def real(low: float, high: float) -> Any:
    """Return the kind of numbers from `low` to `high`."""
    return Annotated[float, Field(ge=low, le=high)]


def listed(kind: Any) -> Any:
    """Return the kind of lists of 1 to 1000 entries of `kind`."""
    return Annotated[list[kind], Field(min_length=1, max_length=1000)]


def distinct(kind: Any) -> Any:
    """Return the kind of lists of 1 to 1000 entries of `kind`, all different."""
    return Annotated[listed(kind), AfterValidator(_without_repeats)]


def _without_repeats(entries: list) -> list:
    if len(set(entries)) < len(entries):
        raise ValueError("should be a list without repeats")
    return entries


Text = Annotated[str, Field(min_length=1)]
Fraction = real(0, 1)
Number = real(-1e6, 1e6)
NotNegative = real(0, 1e12)
Positive = real(1e-12, 1e12)
RateHz = real(1e-3, 1e5)
Seed = whole(0, 2**15 - 1)  # predictions keep seeds in 16 bits
Clocks = Literal["own", "shared"]  # of a recording's devices: each its own, or that of one computer that stamps all

# Kinds of settings of models.
Count = whole(1, 100_000)
Width = whole(1, 8192)  # units of a layer
Widths = listed(Width)
Layers = whole(1, 32)
Degree = whole(1, 5)
Taps = whole(2, 100)  # a filter without a constant needs 2
Neighbours = Literal[4, 8]
Reduction = whole(1, 64)
Share = real(1e-6, 1)
LearningRate = real(1e-9, 10)


class ScheduledTraining(Block):
    """A set number of epochs over which the learning rate rises and falls to zero, see `training.Schedule`.

    `precision` of products in training: bfloat16 where the device has instructions for it, else float32 (the default).
    What comes out of such products is bfloat16, too; weights, the optimiser's sums and all predictions are float32.
    """

    learning_rate: LearningRate  # the highest
    batch_size: whole(1)
    epochs: whole(1)
    precision: Literal["float32", "bfloat16"] = "float32"


class WindowTraining(ScheduledTraining):
    """A schedule on windows, of which an epoch sees all with a touch and a share of the others, drawn anew."""

    rest_share: Share


class SequenceTraining(Block):
    """Training as in the latent-space paper (its authors' script): Adam on the whole series as one sequence.

    The learning rate is multiplied by `drop` after `drop_epoch` epochs; gradients are clipped to norm `clip`.
    `streams`: into how many pieces of equal length, each from a zero state, the series is cut; `batch`: how many of
    them, drawn anew in every epoch, an update sees side by side. 1 and 1 in the paper; more are faster and give more
    updates, but forget what lies before a piece.
    """

    learning_rate: LearningRate
    epochs: whole(1)
    drop_epoch: whole(1)
    drop: Share
    clip: Positive
    streams: whole(1)
    batch: whole(1)


class StretchTraining(Block):
    """Training with Adam on random stretches of `length` samples, each from a zero state.

    The first `warm_up` samples of a stretch do not count in the loss. The learning rate rises to `learning_rate` and
    falls again over the epochs (one cycle, Smith 2018). An epoch is as many stretches as cover the training part once;
    gradients are clipped to norm `clip`.
    """

    learning_rate: LearningRate
    epochs: whole(1)
    batch: whole(1)
    length: whole(1)
    warm_up: whole(0)
    clip: Positive

    @model_validator(mode="after")
    def _something_counts(self) -> "StretchTraining":
        if self.warm_up >= self.length:
            raise ValueError("warm_up should be less than length, or nothing counts")
        return self


class AugmentedTraining(ScheduledTraining):
    """A schedule on images altered anew in every epoch, see `image_classifier.ImageClassifier`.

    flip, affine: probability per image; noise: standard deviation, images being scaled to 0 .. 1.
    """

    flip: Fraction
    noise: Fraction
    affine: Fraction


# Blocks that several experiments have.
Models = Annotated[dict[Any, Any], Field(min_length=1)]  # held against the models' own files by `settings.check_models`


class Seeds(Block):
    seeds: distinct(Seed)


class Split(Block):
    train: Fraction
    validation: Fraction  # share of the training part, its end


class SplitInThree(Block):
    train: Fraction
    validation: Fraction  # share of all, as `train`; the rest is the test part

    @model_validator(mode="after")
    def _leaves_a_test_part(self) -> "SplitInThree":
        if self.train + self.validation >= 1:
            raise ValueError("train and validation leave nothing to test on")
        return self


class Yardstick(Block):
    """The one ratio that a scene's difficulty is set by: the error of `model` over that of `over`.

    A score that is better when higher counts by what is missing to 1.
    """

    model: Text
    over: Text
    protocol: Text
    condition: Text
    metric: Text
    published: Positive  # the same ratio from the paper
    knob: Text  # dotted name, below the experiment, of the setting that it sets


class Window(Block):
    frames: whole(1, 10_000)
    frame_step: whole(1, 10_000)
    stride: whole(1)
    contact_threshold_n: Positive


class LookBack(Block):
    frames: whole(1, 10_000)


class Latency(Block):
    batches: distinct(whole(1, 65536))
    threads: whole(1, 1024)
    warm_up: whole(0)
    calls: whole(1)
    rounds: whole(1, 1000)  # in each of which all models are timed in turn


class LineFaults(Block):
    torn: Fraction
    duplicated: Fraction
    missing: Fraction
    out_of_range: Fraction
    out_of_order: Fraction


class RejectLimit(Block):
    max_reject_fraction: Fraction


class Stress(Block):
    protocols: distinct(Text)
    usable: dict[Text, Positive]  # protocol -> the largest error that is, in the unit of the experiment's error
    perturbations: Annotated[dict[Text, distinct(Number)], Field(min_length=1)]
    recordings: dict[Text, Count] = {}  # of windows: condition -> how many of its recordings, the first, are perturbed

    @model_validator(mode="after")
    def _usable_for_each(self) -> "Stress":
        if set(self.usable) != set(self.protocols):
            raise ValueError(f"usable should have these keys: {', '.join(self.protocols)}")
        return self

    @model_validator(mode="after")
    def _no_zero(self) -> "Stress":
        for name, severities in self.perturbations.items():
            if 0 in severities:
                raise ValueError(f"{name} should not list severity 0, which is always done")
        return self


class SeededStress(Stress):
    seeds: distinct(Seed)


class Ablation(Block):
    seeds: distinct(Seed)
    scene: Annotated[dict[Any, Any], Field(min_length=1)]  # held against the experiment's block where it is used
    models: Models


class AblationRow(Seeds):
    of: Text
    beside: Text = ""  # the row that it is compared with; without it the model `of` of the tables
    frames: whole(1, 10_000)  # last frames of a window that it sees
    settings: dict[Text, Any]  # of the model; with `beside` those that differ from that row's


Touch = block(
    source=Text,
    sensor=block(
        rows=whole(1, 256),
        cols=whole(1, 256),
        pitch_mm=Positive,
        element_mm=Positive,
        order=(Annotated[list[whole(0)], Field(max_length=65536), AfterValidator(_without_repeats)], []),
    ),
    yardstick=Yardstick,
    simulate=block(
        seed=whole(0, 2**31),
        specimen=whole(0, 2**31),
        specimens=whole(1, 1000),
        single=block(points_per_side=whole(1), depths=whole(1), repetitions=whole(1), presses_per_recording=whole(2)),
        double=block(recordings=whole(1), presses_per_recording=whole(2)),
        demonstrations=block(repetitions=whole(1)),
        pressure=block(lowest_kpa=Positive, highest_kpa=Positive, location_spread=Fraction),
        press=block(
            approach_s=Positive,
            hold_s=Positive,
            release_s=Positive,
            rest_s=Positive,
            timing_spread=Fraction,
            cnc_mm_s=Positive,
        ),
        hand=block(
            slower=Positive,
            tip_radius_mm=Positive,
            shift_mm=NotNegative,
            tilt_deg=real(0, 45),
            tremor_share=NotNegative,
            tremor_mm=NotNegative,
        ),
        contact=block(silicone_spread_mm=NotNegative, full_kpa=Positive),
        material=block(resistance_scale_ohm=Positive, correlation_mm=Positive),
        circuit=block(
            supply_v=Positive,
            reference_ohm=Positive,
            driver_ohm=Positive,
            read_us=NotNegative,
            adc_levels=whole(2, 2**31),
            noise_counts=NotNegative,
        ),
        devices=block(
            array_hz=RateHz,
            load_cell_hz=RateHz,
            cnc_hz=RateHz,
            force_noise_n=NotNegative,
            clock_offset_s=NotNegative,
            clock_drift_ppm=NotNegative,
        ),
        faults=block(LineFaults, resets=whole(0)),
        effects=block(
            load_sharing=bool,
            contact_growth=bool,
            places=bool,
            creep=bool,
            slow_creep=bool,
            hysteresis=bool,
            release=bool,
            crosstalk=bool,
            row_sag=bool,
            scan_time=bool,
            noise=bool,
            hand_error=bool,
            line_faults=bool,
        ),
    ),
    ingest=block(
        max_reject_fraction=Fraction,
        max_clock_offset_s=Positive,
        min_correlation=Fraction,
        max_touches=whole(1),
        highest_count=whole(1, 2**31 - 1),
        clock=(Clocks, "own"),
    ),
    window=block(Window, sliding=block(single=Fraction)),
    label=block(
        tip_radius_mm=Positive,
        tip_radius_by_condition_mm=(dict[Text, Positive], {}),
        map_rows=whole(1, 1024),
        map_cols=whole(1, 1024),
    ),
    split=block(SplitInThree, seed=Seed, train_on=(distinct(Text), ["single"])),
    protocols=some_of(press=Seeds, random_window=block(Seeds, passes=whole(1, 1000))),
    models=Models,
    ablation=dict[Text, AblationRow],
    latency=Latency,
)
Strain = block(
    source=Text,
    sensor=block(
        channels=whole(1, 1024),
        unit=(Literal["V", "ohm"], "V"),
        tasks=(dict[Text, distinct(Literal["x", "y", "z"])], {}),
        pressed_below_mm=(Number, None),
    ),
    yardstick=Yardstick,
    simulate=block(
        seed=whole(0, 2**31),
        specimen=whole(0, 2**31),
        specimens=whole(1, 1000),
        samples=whole(100, 10000000),
        motion=block(
            width_mm=Positive,
            height_mm=Positive,
            depth_mm=Positive,
            sliding_depth_mm=Positive,
            slide_slowest_mm_s=Positive,
            slide_fastest_mm_s=Positive,
            press_slowest_mm_s=Positive,
            press_fastest_mm_s=Positive,
            rest_s=NotNegative,
        ),
        finger=block(
            stiffness_n_per_mm=Positive,
            normal_n_per_mm=Positive,
            static_friction=NotNegative,
            kinetic_friction=NotNegative,
            press_bending=Number,
            compression=Number,
            lean=Number,
            friction_spread=NotNegative,
            friction_length_mm=Positive,
            friction_direction=Fraction,
        ),
        strand=block(
            sensitivity_per_mm=Positive,
            gain_spread=NotNegative,
            angle_spread_deg=NotNegative,
            fast_share=Fraction,
            fast_time_s=Positive,
            slow_share=Fraction,
            slow_time_s=Positive,
            break_spread=NotNegative,
            break_time_s=Positive,
            loading_time_s=Positive,
            unloading_time_s=Positive,
        ),
        drift=block(
            wander=NotNegative,
            wander_time_s=Positive,
            ageing=Number,
            ageing_time_s=Positive,
        ),
        circuit=block(supply_v=Positive, reference_share=Positive, noise_v=NotNegative),
        devices=block(
            daq_hz=RateHz,
            robot_hz=RateHz,
            jitter_s=NotNegative,
            clock_offset_s=NotNegative,
            clock_drift_ppm=NotNegative,
        ),
        faults=block(LineFaults, gaps=whole(0), gap_s=NotNegative),
        effects=block(
            relaxation=bool,
            asymmetry=bool,
            drift=bool,
            noise=bool,
            stick_slip=bool,
            friction_spread=bool,
            jitter=bool,
            line_faults=bool,
        ),
    ),
    ingest=block(
        rate_hz=RateHz,
        max_reject_fraction=Fraction,
        max_clock_offset_s=Positive,
        min_correlation=Fraction,
        max_gap_s=Positive,
        clock=(Clocks, "own"),
        average=(bool, False),
    ),
    window=LookBack,
    split=block(Split, test_recordings=(list[Text], [])),
    model_zero=Text,
    protocols=Annotated[dict[Text, Seeds], Field(min_length=1)],
    models=Models,
    study=block(
        tasks=distinct(Literal["task_1", "task_2"]),
        seeds=distinct(Seed),
        samples=distinct(whole(2)),
        models=distinct(Literal["lstm_direct", "lstm_transfer", "lstm_transfer_ridge"]),
        strands=distinct(whole(1, 1024)),
        bases=block(
            trained_on=distinct(Literal["task_0", "task_1", "task_2"]),
            used_for=distinct(Literal["task_0", "task_1", "task_2"]),
        ),
        capacity=block(
            units=distinct(whole(1, 8192)),
            training=block(epochs=whole(1), drop_epoch=whole(1), streams=whole(1), batch=whole(1)),
        ),
    ),
    latency=Latency,
)
StrainRecorded = block(
    ingest=block(every=whole(1), max_reject_fraction=Fraction),
    window=LookBack,
    split=Split,
    model_zero=Text,
    protocols=dict[Text, Seeds],
    models=Models,
    latency=Latency,
)
VelostatRecorded = block(
    sensor=block(rows=Literal[1], cols=Literal[1]),
    label=block(map_rows=Literal[1], map_cols=Literal[1]),
    ingest=RejectLimit,
    window=Window,
    split=block(validation=Fraction),
    protocols=block(
        repetition=Seeds,
        pike1=Seeds,
        pike1_force_1=Seeds,
        pike1_force_5=Seeds,
        pike1_force_10=Seeds,
        pike1_force_20=Seeds,
        pike1_force_30=Seeds,
        pike1_force_40=Seeds,
        pike5_force_20=Seeds,
    ),
    models=Models,
    latency=Latency,
)
Pixels = whole(1, 512)
Glove = block(
    source=Text,
    sensor=block(
        reference_ohm=Positive,
        scale=(Literal["frame", "range"], "frame"),
        areas=(
            dict[
                Text,
                block(
                    rows=Pixels,
                    cols=Pixels,
                    top=(whole(0, 512), 0),
                    left=(whole(0, 512), 0),
                    joint=(whole(1, 64), 1),
                    lowest=(Number, 0),
                    highest=(Number, 1023),
                ),
            ],
            {},
        ),
    ),
    yardstick=Yardstick,
    simulate=block(
        seed=whole(0, 2**31),
        specimen=whole(0, 2**31),
        specimens=whole(1, 1000),
        sessions=whole(1),
        frames_per_object=whole(1),
        frame_hz=RateHz,
        session=block(
            along_mm=NotNegative,
            across_mm=NotNegative,
            tilt_deg=NotNegative,
            margin=Positive,
            margin_spread=NotNegative,
            share_spread=NotNegative,
            seat_spread=NotNegative,
            fit_deg=NotNegative,
            least_grip_n=NotNegative,
            wander=Fraction,
            wander_time_s=Positive,
        ),
        film=block(
            rest_ohm=Positive,
            force_scale=Positive,
            gain_spread=NotNegative,
            rest_bend_ohm=Positive,
            bend_gain=NotNegative,
        ),
        circuit=block(supply_v=Positive, noise_counts=NotNegative),
        faults=LineFaults,
        effects=block(session=bool, wander=bool, element_spread=bool, softness=bool, noise=bool, line_faults=bool),
    ),
    ingest=RejectLimit,
    window=block(stride=whole(1)),
    split=SplitInThree,
    protocols=dict[Text, Seeds],
    models=Models,
    augmentation=block(model=Text, split=Text, seeds=distinct(Seed)),
    input_frames=block(
        dataset=Literal["pressure", "combined"],  # those with claims on figure 15
        split=Text,
        numbers=distinct(whole(1, 8)),
        seeds=distinct(Seed),
    ),
    stag=block(file=Text, seeds=distinct(Seed), validation=Fraction),
    latency=Latency,
)
GloveRecorded = block(
    ingest=RejectLimit,
    window=block(frames=whole(1), stride=whole(1)),
    split=SplitInThree,
    protocols=dict[Text, Seeds],
    models=Models,
    latency=Latency,
)
Physics = block(
    touch=block(Ablation, protocols=distinct(Literal["press"])),
    strain=block(Ablation, protocols=distinct(Literal["task_1", "task_2"])),
    glove=block(Ablation, protocols=distinct(Literal["session_pressure", "session_strain", "session_combined"])),
)
Rightsize = block(
    touch=block(
        lomp=block(Seeds, sizes=distinct(whole(1, 8192))),
        window=block(Seeds, sizes=distinct(whole(1)), training=block(epochs=whole(1))),
    ),
    glove=block(sp_resnet=block(Seeds, sizes=distinct(real(1 / 64, 1.0)))),
)


class Settings(Block):
    """All of params.yaml but `experiments`, their blocks and `stress`: params.settings_block adds these."""

    device: Literal["auto", "cpu", "cuda"]
    physics: Physics
    rightsize: Rightsize
