"""Turn files of columns, of MATLAB, numpy, workbooks or text, into text of lines, which is read as any other log."""

import re
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
import pandas as pd

from tactile.base import foreign
from tactile.base.errors import InputError
from tactile.logs import matlab

LARGEST = 1 << 30  # bytes of a file; as text it takes about three times as many
LIMITS = {"memory": 4 * LARGEST, "seconds": 600}  # of reading
LEAST = 3  # values of a column; fewer are settings of the recording
WORKBOOKS, OTHER_WORKBOOKS = (".xlsx", ".xlsm"), (".xls", ".ods")


def text_of(path: Path, folder: Path) -> dict[str, Path]:
    """Return name -> text file of each table in a file; those that have to be made go into `folder`.

    Columns of one length are a table, which is called by the file, and by the length where there are several. Of an
    array of several dimensions the longest is taken for time; each number of a row is a column then. A file that is of
    neither MATLAB nor numpy is taken for text; each sheet of a workbook is a text of its own. Raises InputError for a
    file that is missing, damaged or an old workbook, and for one without columns.
    """
    if not path.is_file():
        raise InputError(f"{path}: file not found; name a file of columns")
    kind = path.suffix.lower()
    if kind in OTHER_WORKBOOKS:
        raise InputError(
            f"{path}: a workbook of this kind is not read; save it as .xlsx, or each sheet as .csv (UTF-8)"
        )
    if kind in WORKBOOKS:
        return _of_workbook(path, folder)
    if kind not in (".mat", ".npz"):
        return {str(path): path}
    tables: dict[int, dict[str, np.ndarray]] = {}
    variables = matlab.structures(path, LARGEST) if kind == ".mat" else _of_numpy(path)
    for name, values in _columns(variables):
        tables.setdefault(len(values), {})[name] = values
    if not tables:
        raise InputError(
            f"{path}: holds no columns of numbers ({', '.join(variables) or 'it is empty'}); save vectors or matrices, "
            "not tables or objects"
        )
    texts = {}
    for length, columns in tables.items():
        name = f"{path}, columns of {length}" if len(tables) > 1 else str(path)
        texts[name] = folder / f"{path.stem}-{length}.csv"
        pd.DataFrame(columns).to_csv(texts[name], index=False)
    return texts


def _of_workbook(path: Path, folder: Path) -> dict[str, Path]:
    """Write the values of each sheet of a workbook as text, without the formulas that made them."""
    what, remedy = "a whole workbook", "open it and save it again as .xlsx"
    foreign.check_archive(path, what, remedy)
    sheets = foreign.apart(path, what, remedy, _sheets, path, **LIMITS)
    texts = {}
    for number, (sheet, cells) in enumerate(sheets.items()):
        if len(cells) >= LEAST:
            name = f"{path}, sheet {sheet}" if len(sheets) > 1 else str(path)
            texts[name] = folder / f"{path.stem}-{number}.csv"
            cells.to_csv(texts[name], index=False, header=False)
    if not texts:
        raise InputError(f"{path}: no sheet has {LEAST} rows; name a file of columns")
    return texts


def _sheets(path: Path) -> dict[str, pd.DataFrame]:
    return pd.read_excel(path, sheet_name=None, header=None, engine="openpyxl")


def _of_numpy(path: Path) -> dict[str, np.ndarray]:
    """Return the arrays of a file of numpy, of which nothing is executed."""
    what, remedy = "a whole file of numpy's savez, or one of objects", "save arrays of numbers again"
    foreign.check_archive(path, what, remedy)
    return foreign.apart(path, what, remedy, _arrays, path, **LIMITS)


def _arrays(path: Path) -> dict[str, np.ndarray]:
    with np.load(path, allow_pickle=False) as arrays:
        return {name: arrays[name] for name in arrays.files}


def _columns(variables: Mapping, above: str = "") -> Iterator[tuple[str, np.ndarray]]:
    """Yield (name, (n,) values) of all columns in arrays, fields of structures included."""
    for key, value in variables.items():
        name = above + re.sub(r"\W+", "_", str(key))
        if isinstance(value, Mapping):
            yield from _columns(value, f"{name}_")
        elif getattr(value, "dtype", None) is not None and value.dtype.names:
            yield from _columns({field: value[field] for field in value.dtype.names}, f"{name}_")
        elif isinstance(value, np.ndarray) and value.dtype.kind in "biufM" and max(value.shape, default=0) >= LEAST:
            rows = np.moveaxis(value, int(np.argmax(value.shape)), 0).reshape(max(value.shape), -1)
            for k, column in enumerate(rows.T):
                yield (name if rows.shape[1] == 1 else f"{name}_{k + 1}"), column
