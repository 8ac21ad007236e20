"""What our code is measured against: the same results, written as one would without a thought for speed."""

import os
from collections import deque
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.csv
import torch
from torch import nn

from tactile.learning.lomp_network import Lomp
from tactile.learning.training import products_in
from tactile.logs import parse


class LoopedLomp(nn.Module):
    """LoMP, equations 2 to 6, with a GRUCell and a few Linear layers for every element, looped over.

    Starts from the weights of a stacked network; `twins` pairs each tensor with the function that cuts it out there.
    """

    def __init__(self, stacked: Lomp):
        super().__init__()
        spec, hidden = stacked.spec, stacked.hidden
        self.spec, self.hidden, self.alpha = spec, hidden, stacked.alpha
        self.corners = stacked.neighbours[0].sum() > 2  # a corner has 2 neighbours, or 3 with its diagonal one
        cells = range(spec.elements)
        self.gru = nn.ModuleList(nn.GRUCell(1, hidden) for _ in cells)
        self.u = nn.Linear(hidden, hidden)
        self.p = nn.ModuleList(nn.Linear(hidden, hidden) for _ in cells)
        widths = [2 * hidden, *[weight.shape[2] for weight in stacked.readout]]
        self.f = nn.ModuleList(
            nn.ModuleList(nn.Linear(a, b) for a, b in zip(widths[:-1], widths[1:], strict=True)) for _ in cells
        )
        self.twins = [(self.u.weight, lambda s: s.message.T), (self.u.bias, lambda s: s.message_bias)]
        for i in cells:
            gru = self.gru[i]
            self.twins += [
                (gru.weight_ih, lambda s, i=i: torch.cat([s.gate_input[i], s.candidate_input[i]], 1).T),
                (gru.weight_hh, lambda s, i=i: torch.cat([s.gate_state[i], s.candidate_state[i]], 1).T),
                (gru.bias_ih, lambda s, i=i: torch.cat([s.gate_input_bias[i], s.candidate_input_bias[i]], 1)[0]),
                (gru.bias_hh, lambda s, i=i: torch.cat([s.gate_state_bias[i], s.candidate_state_bias[i]], 1)[0]),
                (self.p[i].weight, lambda s, i=i: s.update[i].T),
                (self.p[i].bias, lambda s, i=i: s.update_bias[i, 0]),
            ]
            for k, layer in enumerate(self.f[i]):
                self.twins.append((layer.weight, lambda s, i=i, k=k: s.readout[k][i].T))
                self.twins.append((layer.bias, lambda s, i=i, k=k: s.readout_bias[k][i, 0]))
        with torch.no_grad():
            for mine, theirs in self.twins:
                mine.copy_(theirs(stacked))

    def neighbours(self, i):
        """Numbers of the elements beside element i."""
        row, col = divmod(i, self.spec.cols)
        steps = [(1, 0), (-1, 0), (0, 1), (0, -1)]
        steps += [(1, 1), (1, -1), (-1, 1), (-1, -1)] if self.corners else []
        for r, c in ((row + a, col + b) for a, b in steps):
            if 0 <= r < self.spec.rows and 0 <= c < self.spec.cols:
                yield r * self.spec.cols + c

    def forward(self, x):
        """Windows (n, frames, elements) to maps (n, outputs), both normalised."""
        cells = range(self.spec.elements)
        h = [x.new_zeros(len(x), self.hidden) for _ in cells]
        for t in range(self.spec.frames):
            h1 = [self.gru[i](x[:, t, i : i + 1], h[i]) for i in cells]
            sent = [torch.relu(self.u(state)) for state in h1]
            message = [sum((sent[j] for j in self.neighbours(i)), torch.zeros_like(h1[i])) for i in cells]
            h = [torch.relu(self.p[i](h1[i] + self.alpha * message[i])) for i in cells]
        tall, wide = self.spec.map_rows // self.spec.rows, self.spec.map_cols // self.spec.cols
        image = x.new_zeros(len(x), self.spec.map_rows, self.spec.map_cols)
        for i in cells:
            p = torch.cat([h[i], h1[i]], 1)
            for layer in self.f[i][:-1]:
                p = torch.relu(layer(p))
            row, col = divmod(i, self.spec.cols)
            block = self.f[i][-1](p).view(len(x), tall, wide)
            image[:, row * tall : (row + 1) * tall, col * wide : (col + 1) * wide] = block
        return image.flatten(1)


class StackedLomp(nn.Module):
    """LoMP with the weights of all elements stacked, one batched product a layer, gradients by autograd."""

    def __init__(self, stacked: Lomp):
        super().__init__()
        self.w = stacked

    def forward(self, x):
        """Windows (n, frames, elements) to maps (n, outputs), both normalised."""
        w, hidden = self.w, self.w.hidden
        h = x.new_zeros(w.spec.elements, len(x), hidden)
        for frame in x.permute(1, 2, 0).unsqueeze(3):  # (elements, n, 1)
            gates = frame * w.gate_input + w.gate_input_bias + torch.baddbmm(w.gate_state_bias, h, w.gate_state)
            r, z = torch.sigmoid(gates).split(hidden, 2)
            v = torch.baddbmm(w.candidate_state_bias, h, w.candidate_state)
            c = torch.tanh(frame * w.candidate_input + w.candidate_input_bias + r * v)
            h1 = (1 - z) * c + z * h
            sent = torch.relu(h1 @ w.message + w.message_bias)
            message = torch.einsum("ij,jnh->inh", w.neighbours, sent)
            h = torch.relu(torch.baddbmm(w.update_bias, h1 + w.alpha * message, w.update))
        p = torch.cat([h, h1], 2)
        for k, (weight, bias) in enumerate(zip(w.readout, w.readout_bias, strict=True)):
            p = torch.baddbmm(bias, p, weight)
            if k < len(w.readout) - 1:
                p = torch.relu(p)
        blocks = p.view(w.spec.rows, w.spec.cols, len(x), *w.block)
        return blocks.permute(2, 0, 3, 1, 4).reshape(len(x), w.spec.outputs)


def train_step(network: nn.Module, x: torch.Tensor, y: torch.Tensor, precision: str):
    """A function that makes one update of `network` with Adam on the squared error of one batch.

    precision: of products, as ours.
    """
    optimiser = torch.optim.Adam(network.parameters(), fused=True)

    def step() -> None:
        with products_in(precision, x.device):
            maps = network(x)
        loss = nn.functional.mse_loss(maps.float(), y)
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()

    return step


class PlainLstm(nn.Module):
    """tanh, nn.LSTM, linear read-out: (1, T, channels) to (1, T, outputs)."""

    def __init__(self, channels: int, units: int, outputs: int):
        super().__init__()
        self.lstm = nn.LSTM(channels, units, batch_first=True)
        self.readout = nn.Linear(units, outputs, bias=False)

    def forward(self, x):
        return self.readout(self.lstm(torch.tanh(x))[0])


def lstm_epochs(network: PlainLstm, x: torch.Tensor, y: torch.Tensor, epochs: int, rate: float, clip: float) -> None:
    """The authors' recipe: the whole series as one sequence, one clipped update of what can be trained an epoch."""
    weights = [weight for weight in network.parameters() if weight.requires_grad]
    optimiser = torch.optim.Adam(weights, lr=rate)
    for _ in range(epochs):
        loss = nn.functional.mse_loss(network(x), y)
        optimiser.zero_grad()
        loss.backward()
        nn.utils.clip_grad_norm_(weights, clip)
        optimiser.step()


def readout_epochs(readout: nn.Linear, latent: torch.Tensor, y: torch.Tensor, epochs: int, drop_epoch: int) -> None:
    """Adam on the read-out alone, on states (T, units) that are computed already; rate 0.05, then 0.01."""
    optimiser = torch.optim.Adam(readout.parameters(), lr=0.05)
    for epoch in range(epochs):
        if epoch == drop_epoch:
            optimiser.param_groups[0]["lr"] = 0.01
        loss = nn.functional.mse_loss(readout(latent), y)
        optimiser.zero_grad()
        loss.backward()
        nn.utils.clip_grad_norm_(readout.parameters(), 1.0)
        optimiser.step()


def reservoir_states(system: dict[str, np.ndarray], leak: float, x: np.ndarray) -> np.ndarray:
    """States (T, units) of an echo state network for normalised inputs (T, channels), sample by sample."""
    w, v, b = system["reservoir"], system["input"], system["bias"]
    s = np.zeros(len(w), np.float32)
    states = np.empty((len(x), len(w)), np.float32)
    for t in range(len(x)):
        s = (1 - leak) * s + leak * np.tanh(w @ s + np.tanh(x[t]) @ v + b)
        states[t] = s
    return states


def read_log(path: Path, names: list[str], threads: int | None = None) -> pd.DataFrame:
    """A log as pandas reads it: the banner in line 1 and lines with too many columns left out, nothing checked.

    threads: None for pandas' choice, which since version 3.1 is all cores; before that it had one.
    """
    with pd.option_context("mode.max_threads", threads):
        return pd.read_csv(path, names=names, skiprows=1, on_bad_lines="skip")


def read_log_polars(path: Path, names: list[str]) -> int:
    """Read a log with polars, its types given, nothing else checked: what is no number is null; returns its rows."""
    import polars

    types = dict.fromkeys(names, polars.Int64)
    rules = {"ignore_errors": True, "truncate_ragged_lines": True, "quote_char": None}
    return len(polars.read_csv(path, has_header=False, skip_rows=1, schema=types, **rules))


def read_log_duckdb(path: Path, names: list[str]) -> int:
    """Read a log with DuckDB into an Arrow table, its types given, lines that do not fit left out; returns its rows."""
    import duckdb

    types = dict.fromkeys(names, "BIGINT")
    rules = {"header": False, "skiprows": 1, "ignore_errors": True, "quotechar": "", "escapechar": ""}
    return duckdb.read_csv(str(path), columns=types, sep=",", auto_detect=False, **rules).to_arrow_table().num_rows


def parse_log(path: Path, names: list[str]) -> int:
    """Parse a log with pyarrow alone, nothing checked, in pieces on all cores as ours; returns the number of rows.

    Ours parses with pyarrow too, so this is the limit of its speed.
    """
    read = pyarrow.csv.ReadOptions(use_threads=False, column_names=names, block_size=2 * parse.PIECE)
    rules = pyarrow.csv.ParseOptions(quote_char=False, invalid_row_handler=lambda _: "skip")
    types = pyarrow.csv.ConvertOptions(column_types=dict.fromkeys(names[1:], pa.int16()))

    def rows(piece: bytes) -> int:
        return pyarrow.csv.read_csv(pa.BufferReader(piece), read, rules, types).num_rows

    with path.open("rb") as file, ThreadPoolExecutor() as pool:
        file.readline()  # the banner
        edge, waiting, total = b"", deque(), 0
        while block := file.read(parse.PIECE):
            whole = block.rfind(b"\n") + 1
            waiting.append(pool.submit(rows, edge + block[:whole]))
            edge = block[whole:]
            if len(waiting) > 2 * os.cpu_count():
                total += waiting.popleft().result()
        return total + sum(piece.result() for piece in waiting)


def image_epoch(network: nn.Module, x: torch.Tensor, y: torch.Tensor, batch: int, augment) -> None:
    """One epoch of a classifier of images (n, 1, side, side): shuffle, alter, update with Adam on the cross-entropy."""
    optimiser = torch.optim.Adam(network.parameters())
    network.train()
    for rows in torch.randperm(len(x)).split(batch):
        loss = nn.functional.cross_entropy(network(augment(x[rows])), y[rows])
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
