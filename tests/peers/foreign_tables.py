"""One CSV table as a workbook, as Parquet and as NumPy arrays: foreign_tables.py TABLE.csv FOLDER."""
import csv
import sys

import numpy
import openpyxl
import pyarrow
import pyarrow.parquet

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
