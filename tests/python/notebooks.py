"""Runs the notebooks of python/notebooks with a real kernel and holds their outputs against those that are kept.

    notebooks.py SOURCE FOLDER [--update]

Each runs in a copy under FOLDER. Texts must be equal, their decimals within one in the last digit shown (rounding may differ between
processors); a picture must be there. ``--update`` writes the
outputs into SOURCE instead. Prints seconds and MB for each.
"""

import re
import shutil
import sys
import tempfile
import time
from decimal import Decimal
from pathlib import Path

import nbformat
from jupyter_client import AsyncKernelManager
from nbclient import NotebookClient

NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")
SOURCE, FOLDER = Path(sys.argv[1]), Path(sys.argv[2])
UPDATE = "--update" in sys.argv


def said(cell) -> list[tuple[str, str]]:
    """What a cell puts out, as kind and text; of a picture only that it is there."""
    told: list[tuple[str, str]] = []
    for output in cell.outputs:
        if output.output_type == "stream":
            assert output.name == "stdout", f"a cell complains: {output.text}"
            told.append(("text", output.text))
        elif output.output_type == "error":
            raise AssertionError("\n".join(output.traceback))
        else:
            told.append(("picture", "") if "image/png" in output.data else ("text", output.data["text/plain"]))
    return told


def same(kept: str, now: str) -> bool:
    if NUMBER.sub("#", kept) != NUMBER.sub("#", now):
        return False
    pairs = zip(NUMBER.findall(kept), NUMBER.findall(now), strict=True)
    return all(a == b or ("." in a and abs(Decimal(a) - Decimal(b)) <= last_digit(a)) for a, b in pairs)


def last_digit(number: str) -> Decimal:
    """One in the last digit of a number as it is written."""
    return Decimal((0, (1,), int(Decimal(number).as_tuple().exponent)))


assert same("0.0916 of 64", "0.0917 of 64") and not same("0.0916", "0.0918") and not same("64", "65") and not same("1.2e-3 N", "1.2e-3 m")


notebooks = sorted(SOURCE.glob("*.ipynb"))
assert notebooks, f"no notebook in {SOURCE}"
for path in notebooks:
    work = FOLDER / path.stem
    shutil.copytree(SOURCE, work)
    kept = nbformat.read(path, as_version=4)
    ran = nbformat.from_dict(kept)
    for cell in ran.cells:
        if cell.cell_type == "code":
            cell.outputs, cell.execution_count = [], None
    began = time.perf_counter()
    # By way of the file system, under a short name (a socket's may have 107 characters): no port is opened.
    sockets = tempfile.mkdtemp()
    kernel = AsyncKernelManager(kernel_name="python3", transport="ipc", ip=f"{sockets}/kernel")
    NotebookClient(ran, km=kernel, timeout=300, resources={"metadata": {"path": str(work)}}).execute()
    shutil.rmtree(sockets)
    took = time.perf_counter() - began
    cells = [(a, b) for a, b in zip(kept.cells, ran.cells, strict=True) if a.cell_type == "code"]
    if UPDATE:
        for _, cell in cells:
            cell.metadata = {}
            said(cell)
        ran.metadata = {"kernelspec": kept.metadata["kernelspec"]}
        nbformat.write(ran, path)
    else:
        for number, (a, b) in enumerate(cells, 1):
            before, now = said(a), said(b)
            alike = len(before) == len(now) and all(k == l and same(x, y) for (k, x), (l, y) in zip(before, now, strict=True))
            assert alike, f"{path.name}, code cell {number}: kept\n{before}\nnow\n{now}"
    print(f"{path.name}: {len(cells)} cells in {took:.1f} s, {path.stat().st_size / 1e6:.2f} MB")
print("ok")
