"""One CSV table as a workbook, as Parquet, as NumPy arrays, as MAT files and as HDF5: foreign_tables.py TABLE.csv FOLDER."""
import csv
import sys

import h5py
import numpy
import openpyxl
import pyarrow
import pyarrow.parquet
import scipy.io

table, folder = sys.argv[1:]
with open(table, encoding="utf-8") as source:
    header, *rows = list(csv.reader(source))
numbers = [[float(cell) for cell in row] for row in rows]

book = openpyxl.Workbook()
notes = book.active
notes.title = "Notes"
notes.append(["measured by hand"])
sheet = book.create_sheet("Friction")
sheet.append(["Sample", "silicone"])
sheet.append([])
sheet.append(header)
for row in numbers:
    sheet.append(row)
book.save(f"{folder}/book.xlsx")

columns = {name: [row[k] for row in numbers] for k, name in enumerate(header)}
pyarrow.parquet.write_table(pyarrow.table(columns), f"{folder}/table.parquet")

records = numpy.array([tuple(row) for row in numbers], dtype=[(name, "<f8") for name in header])
numpy.save(f"{folder}/records.npy", records)
numpy.save(f"{folder}/matrix.npy", numpy.asfortranarray(numpy.array(numbers)))

arrays = {name: numpy.array(values) for name, values in columns.items()}
# Columns side by side, rows of numbers, a constant and words; compressed and not; a structure beside another length; one matrix.
scipy.io.savemat(f"{folder}/columns.mat", {**arrays, "plate": 3.0, "who": "somebody"}, oned_as="row")
scipy.io.savemat(f"{folder}/packed.mat", {"sweep": arrays, "raw": numpy.arange(1000.0)}, do_compression=True, oned_as="column")
scipy.io.savemat(f"{folder}/matrix.mat", {"M": numpy.array(numbers)}, do_compression=True)

with h5py.File(f"{folder}/table.h5", "w") as out:
    group = out.create_group("run/sweep")
    for name, values in arrays.items():
        group.create_dataset(name, data=values, compression="gzip", shuffle=True, fletcher32=True, chunks=(5,))
    out["raw"] = numpy.zeros((40, 3), dtype="<i4")
    out["note"] = "words"
with h5py.File(f"{folder}/matrix.h5", "w", libver="latest") as out:
    out["M"] = numpy.array(numbers)
# As MATLAB writes -v7.3: a block of text before the file, dimensions the other way round.
with h5py.File(f"{folder}/new.mat", "w", userblock_size=512) as out:
    out.create_dataset("M", data=numpy.array(numbers).T).attrs["MATLAB_class"] = numpy.bytes_("double")
with open(f"{folder}/new.mat", "r+b") as out:
    out.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM")
