"""Quantities of a motion as tables of pandas and data sets of xarray."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING

import numpy as np

from shaftwork.core.errors import imported
from shaftwork.results.observer import Array, Reader

if TYPE_CHECKING:
    import pandas as pd
    import xarray


def to_pandas(reader: Reader, t: Array, x: Array, names: Iterable[str]) -> pd.DataFrame:
    """A table over time of quantities; see `Solution.to_pandas`."""
    frame = imported("pandas", "data", "Solution.to_pandas()")
    columns = {title: column for name in names for title, column in _columns(reader, t, x, name)}
    return frame.DataFrame(columns, index=frame.Index(t, name="t"))


def _columns(reader: Reader, t: Array, x: Array, name: str) -> Iterator[tuple[str, Array]]:
    """A quantity in columns (k,) with their titles."""
    values = reader.values(name, t, x)
    if values.ndim == 1:
        yield name, values
    else:
        yield from zip((f"{name} at {place:g} m" for place in reader.places(name)), values.T, strict=True)


def to_xarray(reader: Reader, t: Array, x: Array, names: Iterable[str]) -> xarray.Dataset:
    """A data set over time of quantities; see `Solution.to_xarray`."""
    library = imported("xarray", "data", "Solution.to_xarray()")
    coords = {"t": ("t", t, {"units": "s"})}
    data = {}
    for name in names:
        values, along = reader.values(name, t, x), f"{name}.x"
        if values.ndim > 1:
            coords[along] = (along, np.array(reader.places(name)), {"units": "m"})
        data[name] = (("t", along)[: values.ndim], values, {"units": reader.unit(name)})
    return library.Dataset(data, coords=coords, attrs={"title": reader.title})  # type: ignore[no-any-return]
