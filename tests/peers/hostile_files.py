"""Small files that say they are huge, each read by `muprime import`: hostile_files.py FOLDER MUPRIME prints, a line each as JSON, the
name, the exit status, the processor time in s and the largest memory in bytes.
"""
import gzip
import io
import json
import os
import struct
import sys
import zipfile
import zlib

import h5py
import numpy
import openpyxl

folder, program = sys.argv[1:]


def write(name, data):
    with open(f"{folder}/{name}", "wb") as out:
        out.write(data)


def npy(shape, kind="<f8", order=False):
    head = f"{{'descr': '{kind}', 'fortran_order': {order}, 'shape': {shape}, }}".encode()
    head += b" " * (117 - len(head)) + b"\n"
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(head)) + head


for k, shape in enumerate(["(0, 100000000000)", "(100000000000, 0)", "(3, 18446744073709551615)", "(9223372036854775807, 4)", "(100000000000,)"]):
    write(f"shape-{k}.npy", npy(shape))
write("long-header.npy", b"\x93NUMPY\x02\x00\xff\xff\xff\xff" + b"{" * 50)

book = openpyxl.Workbook()
book.active["A1"] = 1
book.active["XFD1048576"] = 2
book.save(f"{folder}/far.xlsx")
book = openpyxl.Workbook()
for k in range(1, 400):
    book.active.cell(k, 16384, 1.0)
book.save(f"{folder}/wide.xlsx")


def swap(name, path, part, data):
    with zipfile.ZipFile(f"{folder}/{name}") as old, zipfile.ZipFile(f"{folder}/{path}", "w", zipfile.ZIP_DEFLATED) as new:
        for entry in old.namelist():
            new.writestr(entry, data if entry == part else old.read(entry))


long = b'<worksheet xmlns="http://schemas.openxmlformats.org/spreadsheetml/2006/main"><sheetData><row r="1">' + b"<c><v>1</v></c>" * 40_000_000
swap("far.xlsx", "bomb.xlsx", "xl/worksheets/sheet1.xml", long + b"</row></sheetData></worksheet>")

NS = ('xmlns:office="urn:oasis:names:tc:opendocument:xmlns:office:1.0" xmlns:table="urn:oasis:names:tc:opendocument:xmlns:table:1.0" '
      'xmlns:text="urn:oasis:names:tc:opendocument:xmlns:text:1.0"')
cell = '<table:table-cell table:number-columns-repeated="16000" office:value-type="float" office:value="1"><text:p>1</text:p></table:table-cell>'
content = (f'<?xml version="1.0"?><office:document-content {NS}><office:body><office:spreadsheet><table:table table:name="a">'
           f'<table:table-row table:number-rows-repeated="6000">{cell}</table:table-row></table:table></office:spreadsheet></office:body>'
           '</office:document-content>')
with zipfile.ZipFile(f"{folder}/repeated.ods", "w", zipfile.ZIP_DEFLATED) as out:
    out.writestr("mimetype", "application/vnd.oasis.opendocument.spreadsheet")
    out.writestr("content.xml", content)


def element(kind, data):
    return struct.pack("<II", kind, len(data)) + data + b"\0" * (-len(data) % 8)


def matrix(name, rows, columns, kind, size):
    head = element(6, struct.pack("<II", kind, 0)) + element(5, struct.pack("<ii", rows, columns)) + element(1, name)
    return struct.pack("<II", 14, len(head) + 8 + size) + head + struct.pack("<II", 2 if kind == 9 else 9, size)


top = b"MATLAB 5.0 MAT-file".ljust(124) + struct.pack("<H", 0x0100) + b"IM"
for name, kind, size in [("bytes", 9, 1_000_000_000), ("doubles", 6, 400_000_000)]:
    packer = zlib.compressobj(9)
    packed = packer.compress(matrix(b"x", size if kind == 9 else size // 8, 1, kind, size))
    for _ in range(size // 10_000_000):
        packed += packer.compress(bytes(10_000_000))
    packed += packer.flush()
    write(f"{name}.mat", top + struct.pack("<II", 15, len(packed)) + packed)
small = zlib.compress(matrix(b"x", 3, 1, 9, 3) + bytes(9_000_000), 9)
write("many.mat", top + (struct.pack("<II", 15, len(small)) + small) * 60)
with h5py.File(f"{folder}/empty.h5", "w") as out:
    out.create_dataset("x", (10**9,), "f8", chunks=(1000,), compression="gzip")
with h5py.File(f"{folder}/flat.h5", "w") as out:
    out.create_dataset("x", (10**10, 4), "f8", chunks=(1000, 4))
with h5py.File(f"{folder}/zeros.h5", "w") as out:
    out.create_dataset("x", data=numpy.zeros(40_000_000), chunks=(1_000_000,), compression="gzip")

# In a process of its own: a child's largest memory is at least what its parent had when it began.
os.execv(sys.executable, [sys.executable, os.path.join(os.path.dirname(__file__), "import_costs.py"), folder, program])
