"""Name models and columns as the reports do."""

FRONTS = {"p50_ms": "speed_front", "train_s": "training_front"}  # measured time -> the column of its Pareto front
SPREAD = {"p50_ms": ["p50_low_ms", "p50_high_ms"], "train_s": ["train_low_s", "train_high_s"]}  # -> its least and most
LABELS = {
    "constant": "Constant (mean)",
    "linear": "Linear",
    "poly": "Polynomial",
    "poly_powers": "Polynomial, powers only",
    "tree": "Decision tree",
    "rbf": "RBF-Net",
    "cnn": "CNN",
    "vgg": "VGG-16",
    "convlstm": "ConvLSTM",
    "rnn": "RNN",
    "lomp": "LoMP",
    "lomp_stream": "LoMP streaming",
    "ridge": "Ridge, raw window",
    "esn": "Echo state network",
    "lstm_direct": "LSTM, direct",
    "lstm_transfer": "LSTM, transfer (Adam)",
    "lstm_highpass": "LSTM on high-passed voltages",
    "press_difference": "Extra trees, press minus rest",
    "lstm_transfer_ridge": "LSTM, transfer (closed form)",
    "naive_bayes": "Naive Bayes",
    "resnet18": "ResNet-18",
    "mobilenet": "MobileNet",
    "resnet3x3": "ResNet_3x3",
    "sp_resnet_nogcam": "SP-ResNet (no GCAM)",
    "sp_resnet": "SP-ResNet",
}


def model_name(model: str) -> str:
    """Return the name of a model in tables and sentences: as the paper prints it, or its key where there is none."""
    return LABELS.get(model, model)
