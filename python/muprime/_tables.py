"""Tables as text: how a data frame goes to the crates."""

from __future__ import annotations

import io
from typing import Any


def csv_bytes(table: Any) -> bytes:
    """A point table from a data frame of pandas or polars, or an Arrow table, at full precision."""
    if hasattr(table, "write_csv"):
        text = table.write_csv()
        return text.encode() if isinstance(text, str) else bytes(text)
    if hasattr(table, "to_csv"):
        return bytes(table.to_csv(index=False), "utf-8")
    if hasattr(table, "to_pylist"):
        import csv

        out = io.StringIO()
        writer = csv.DictWriter(out, table.column_names, lineterminator="\n")
        writer.writeheader()
        writer.writerows(table.to_pylist())
        return out.getvalue().encode()
    raise TypeError(f"a table is a path, a Run, or a data frame of pandas, polars or Arrow, not {type(table).__name__}")
