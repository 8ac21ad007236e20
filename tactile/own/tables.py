"""Turn files of columns, of MATLAB, numpy, HDF5, Parquet, workbooks or text, into text of lines, as any other log."""

import re
from collections.abc import Collection, Iterator, Mapping
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from tactile.base import foreign
from tactile.base.errors import InputError
from tactile.logs import matlab

LARGEST = 1 << 30  # bytes of a file; as text it takes about three times as many
LIMITS = {"memory": 4 * LARGEST, "seconds": 600}  # of reading
LEAST = 3  # values of a column; fewer are settings of the recording
KINDS = (".csv", ".tsv", ".txt", ".dat", ".xlsx", ".parquet", ".mat", ".npy", ".npz", ".h5", ".hdf5", ".gz")
WORDS = (pa.types.is_string, pa.types.is_large_string, pa.types.is_boolean)
WORKBOOKS, OTHER_WORKBOOKS = (".xlsx", ".xlsm"), (".xls", ".ods")


def text_of(path: Path, folder: Path, words: Collection[str] = ()) -> dict[str, Path]:
    """Return name -> text file of each table in a file; those that have to be made go into `folder`.

    Columns of one length are a table, which is called by the file, and by the length where there are several. Of an
    array of several dimensions the longest is taken for time; each number of a row is a column then. A file of none of
    these kinds is taken for text; each sheet of a workbook is a text of its own. words: columns that are kept
    though they are of words. Raises InputError for a file that is missing, damaged or an old workbook, and for one
    without columns.
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
    if kind == ".parquet":
        variables, others = _of_parquet(path, words)
    elif kind in (".h5", ".hdf5", ".hdf") or kind == ".mat" and matlab.is_hdf5(path):
        variables, others = _of_hdf5(path), {}
    elif kind in (".npy", ".npz"):
        variables, others = _of_numpy(path), {}
    elif kind == ".mat":
        variables, others = matlab.structures(path, LARGEST), {}
    else:
        return {str(path): path}
    tables: dict[int, dict[str, np.ndarray]] = {}
    for name, values in (*_columns(variables), *others.items()):
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


def inside(folder: Path) -> list[Path]:
    """Return the files of a folder, at any depth, that can be tables, sorted; without hidden ones."""
    found = (path for path in folder.rglob("*") if path.suffix.lower() in KINDS and path.is_file())
    return sorted(path for path in found if not any(part[0] == "." for part in path.relative_to(folder).parts))


def trials(texts: Mapping[str, Path], column: str, folder: Path) -> dict[str, dict[str, Path]]:
    """Return the name of each trial -> its texts, as of `text_of`: tables divided by the values of a column.

    Their rows stay in order, and the column is left out; a table that has no such column is left out, too. A trial is
    called by the column and its value. Raises InputError where no table has the column, or one cannot be divided.
    """
    found: dict[str, dict[str, Path]] = {}
    values: dict[str, str] = {}
    others = set()
    for number, (table, text) in enumerate(texts.items()):
        with foreign.reading(text, "a table with the names of its columns in the first line", "save it as such"):
            rows = pd.read_csv(text, sep=None, engine="python", dtype=str, keep_default_na=False)
        if column not in rows:
            others |= set(rows)
            continue
        for value, of_trial in rows.groupby(column, sort=False):
            trial = trial_name(column, value)
            if values.setdefault(trial, value) != value:
                raise InputError(f"{table}: {values[trial]} and {value} of {column} are both {trial}; rename one")
            place = folder / f"{number}-{trial}.csv"
            of_trial.drop(columns=column).to_csv(place, index=False)
            found.setdefault(trial, {})[f"{table}, {column} {value}"] = place
    if not found:
        raise InputError(f"{', '.join(texts)}: no column {column}; the columns are {', '.join(sorted(others))}")
    return found


def trial_name(column: str, value: str) -> str:
    """Return the name of the folder of a trial."""
    return re.sub(r"[^\w.-]+", "_", f"{column}-{value}")


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
    what, remedy = "a whole file of numpy's save or savez, or one of objects", "save arrays of numbers again"
    if path.suffix.lower() == ".npz":
        foreign.check_archive(path, what, remedy)
    return foreign.apart(path, what, remedy, _arrays, path, **LIMITS)


def _arrays(path: Path) -> dict[str, np.ndarray]:
    arrays = np.load(path, allow_pickle=False)
    if isinstance(arrays, np.ndarray):
        return {path.stem: arrays}
    with arrays:
        return {name: arrays[name] for name in arrays.files}


def _of_hdf5(path: Path) -> dict[str, np.ndarray]:
    """Return the data sets of an HDF5 file, also of MATLAB 7.3, by the path of each."""
    import h5py  # noqa: F401  which an extra has: the sentence says so

    return foreign.apart(path, "a whole HDF5 file", "save it again", _data_sets, path, **LIMITS)


def _data_sets(path: Path) -> dict[str, np.ndarray]:
    """Return what the file itself holds: links to other files are not followed."""
    import h5py

    found = {}

    def keep(name: str, item: object) -> None:
        if isinstance(item, h5py.Dataset) and not (item.external or item.is_virtual):
            text = item.attrs.get("MATLAB_class") == b"char"
            if item.dtype.kind in "biuf" and not text:
                found[name] = item[()]

    with h5py.File(path, "r") as file:
        file.visititems(keep)
    return found


def _of_parquet(path: Path, words: Collection[str]) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    """Return the columns of numbers, lists of equal length as (n, length), and those of `words` that are words."""
    what, remedy = "a whole Parquet file", "write it again"
    return foreign.apart(path, what, remedy, _parquet, path, words, **LIMITS)


def _parquet(path: Path, kept: Collection[str]) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    table, numbers, words = pq.read_table(path, memory_map=False), {}, {}
    while any(pa.types.is_struct(each) for each in table.schema.types):
        table = table.flatten()
    for name, column in zip(table.column_names, table.columns, strict=True):
        values, shape = column.combine_chunks(), [len(column)]
        if pa.types.is_dictionary(values.type):
            values = values.dictionary_decode()
        while pa.types.is_list(values.type) or pa.types.is_large_list(values.type) or _is_fixed(values.type):
            inner = values.flatten()
            if not len(values) or values.null_count or len(pc.unique(pc.list_value_length(values))) != 1:
                break
            shape.append(len(inner) // len(values))
            values = inner
        if pa.types.is_integer(values.type) or pa.types.is_floating(values.type) or pa.types.is_temporal(values.type):
            numbers[name] = values.to_numpy(zero_copy_only=False).reshape(shape)
        elif name in kept and any(kind(values.type) for kind in WORDS):
            words[name] = values.to_numpy(zero_copy_only=False)
    return numbers, words


def _is_fixed(kind: pa.DataType) -> bool:
    return pa.types.is_fixed_size_list(kind)


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
