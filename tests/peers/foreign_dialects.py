"""One table of friction in many dialects: foreign_dialects.py FOLDER writes the files and prints, a line each as JSON, the name, the
arguments of `muprime import`, and what is right: "right" (the table), "either" (the table or a refusal) or "refused".
"""
import json
import sys

import h5py
import numpy
import openpyxl
import pyarrow
import pyarrow.feather
import pyarrow.parquet
import scipy.io

folder = sys.argv[1]
N = 14
TIME = [2 * k for k in range(N)]
SPEED = [10 if k < 7 else 20 for k in range(N)]
LOAD = [round(2 + 0.05 * k, 3) for k in range(N)]
FRICTION = [round(0.8 + 0.003 * k, 4) for k in range(N)]
NAMES = ["Time (s)", "Speed (mm/s)", "Load (N)", "Friction (N)"]
ROWS = [list(row) for row in zip(TIME, SPEED, LOAD, FRICTION)]
SET = "amplitude_pp_m=0,direction=1"
print(json.dumps({"truth": ROWS}))


def tell(name, expect="right", given=SET, *more):
    print(json.dumps({"file": name, "expect": expect, "args": ["--set", given, *(more or ["--yes"])]}))


def text(name, body, expect="right", given=SET, *more, encoding="utf-8"):
    with open(f"{folder}/{name}", "wb") as out:
        out.write(body if isinstance(body, bytes) else body.encode(encoding))
    tell(name, expect, given, *more)


def lines(rows, mark=",", comma=False, end="\n", tail=""):
    def cell(value):
        written = str(value)
        return written.replace(".", ",") if comma and isinstance(value, float) else written

    return "".join(mark.join(cell(c) for c in row) + tail + end for row in rows)


# Delimiters, marks, encodings.
text("commas.csv", lines([NAMES, *ROWS]))
text("semicolons.csv", lines([NAMES, *ROWS], ";", True))
text("tabs.txt", lines([NAMES, *ROWS], "\t", True, "\r\n"))
text("bars.txt", lines([NAMES, *ROWS], "|"))
text("blanks.txt", lines([["t_s", "v_mm_s", "Fn_N", "Ff_N"], *ROWS], "   "))
text("blanks-brackets.txt", lines([NAMES, *ROWS], "  "))
text("one-blank-brackets.txt", lines([NAMES, *ROWS], " "))
text("quoted.csv", lines([[f'"{n}"' for n in NAMES], *ROWS], ";"))
text("mark.csv", "\ufeff" + lines([NAMES, *ROWS]))
text("wide.txt", lines([NAMES, *ROWS], "\t"), encoding="utf-16")
text("latin.csv", lines([["Zeit (s)", "Geschwindigkeit (mm/s)", "Normalkraft (N)", "Reibkraft (N)", "Öl (°C)"], *[r + [20] for r in ROWS]], ";"),
     encoding="latin-1")
text("trailing.csv", lines([NAMES, *ROWS], ";", tail=";"))
text("preamble.csv", "Tribometer 7\nOperator;A. Nonym\n\n" + lines([NAMES, *ROWS], ";"))
text("remarks.csv", lines([NAMES + ["Remark"], *[r + ["ok" if k % 3 else ""] for k, r in enumerate(ROWS)]]))
text("row-names.txt", lines([[f'"{n}"' for n in NAMES], *[[f'"{k + 1}"', *r] for k, r in enumerate(ROWS)]], " "))
text("index.csv", lines([["", *NAMES], *[[k, *r] for k, r in enumerate(ROWS)]]))
# Empty cells.
text("empty-tabs.txt", lines([["Friction (N)", "Load (N)", "Remark", "Step Time (s)", "Speed (mm/s)"],
                             *[[f, l, "", t, v] for t, v, l, f in ROWS]], "\t"), "right", SET, "--map",
     "Friction (N)=friction_force:N,Load (N)=normal_force:N,Step Time (s)=time:s,Speed (mm/s)=speed:mm/s")
text("empty-first.txt", lines([["Note here", *NAMES], *[["", *r] for r in ROWS]], "\t"))
text("seven-words.txt", "the friction of this film and its load\n" + lines(ROWS, " "), "refused")
# Units in rows.
UNITS = ["s", "mm/s", "N", "N"]
BARE = ["Time", "Speed", "Load", "Friction"]
text("unit-row.csv", lines([BARE, UNITS, *ROWS]))
text("unit-row-brackets.csv", lines([BARE, [f"[{u}]" for u in UNITS], *ROWS], ";"))
text("unit-row-above.csv", lines([UNITS, BARE, *ROWS]))
for k, unit in enumerate(["ohm", "V", "J", "Nmm", "rev", "counts", "N/mm", "m/s2", "a.u.", "n/a"]):
    text(f"unit-row-{k}.csv", lines([BARE + ["Other"], UNITS + [unit], *[r + [k] for r in ROWS]]))
text("unit-row-milli.csv", lines([BARE, ["ms", "um/s", "mN", "mN"],
                                 *[[1000 * t, 1000 * v, round(1000 * l), round(1000 * f, 1)] for t, v, l, f in ROWS]]))
text("unit-wrong.csv", lines([BARE, ["s", "rpm", "N", "N"], *ROWS]), "refused")
# Blocks, each with a header of its own.
half = 7
first, second = [NAMES, *ROWS[:half]], ROWS[half:]
text("again-same.csv", lines([*first, NAMES, *second]))
text("again-order.csv", lines([*first, [NAMES[k] for k in (0, 3, 2, 1)], *[[r[k] for k in (0, 3, 2, 1)] for r in second]]))
text("again-step.csv", "Step 1\n" + lines(first) + "\nStep 2\n" + lines([[NAMES[k] for k in (3, 0, 1, 2)], *[[r[k] for k in (3, 0, 1, 2)] for r in second]]))
text("again-units.csv", lines([*first, ["Time (s)", "Speed (mm/s)", "Load (mN)", "Friction (mN)"],
                               *[[t, v, round(1000 * l), round(1000 * f, 1)] for t, v, l, f in second]]))
text("again-unit-rows.csv", lines([BARE, UNITS, *ROWS[:half], BARE, ["s", "mm/s", "N", "mN"],
                                   *[[t, v, l, round(1000 * f, 1)] for t, v, l, f in second]]))
text("again-more.csv", lines([*first, [NAMES[0], "Humidity (%)", *NAMES[1:]], *[[r[0], 50, *r[1:]] for r in second]]))
text("again-fewer.csv", lines([*first, [NAMES[0], NAMES[2], NAMES[3]], *[[r[0], r[2], r[3]] for r in second]]), "refused")
text("again-comment.txt", "# t_s Fn_N Ff_N v_mm_s\n" + lines([[r[k] for k in (0, 2, 3, 1)] for r in ROWS[:half]], " ")
     + "# t_s Ff_N Fn_N v_mm_s\n" + lines([[r[k] for k in (0, 3, 2, 1)] for r in second], " "))
text("summary.csv", lines([NAMES, *ROWS]) + "\nSummary\nMean COF;SD\n".replace(";", ",") + "0.39,0.01\n", "either")
text("comments-between.csv", lines(first) + "# 5 N, 20 mm/s, 3\n" + lines(second))
text("header-late.csv", lines(ROWS[:3]) + lines([NAMES, *ROWS[3:]]), "either")


# Clocks.
def clocked(name, stamp, expect="right", unit="Time", rows=ROWS, *more, given=SET):
    text(name, lines([[unit, *NAMES[1:]], *[[stamp(r[0]), *r[1:]] for r in rows]], ";"), expect, given, *more)


def hms(s):
    return f"{s // 3600 % 24:02}:{s // 60 % 60:02}:{s % 60:02}"


clocked("clock.csv", lambda s: hms(36000 + s))
clocked("midnight.csv", lambda s: hms(86390 + s))
clocked("dated.csv", lambda s: f"2024-02-{28 + (86390 + s) // 86400} {hms(86390 + s)}")
clocked("half-days.csv", lambda s: f"{11 if s < 10 else 12}:{(50 + s) // 60 % 60 + (59 if s < 10 else -1):02}:{(50 + s) % 60:02} {'AM' if s < 10 else 'PM'}")
clocked("stopwatch.csv", lambda s: f"{(50 + s) // 60:02}:{(50 + s) % 60:02}.0")
clocked("stopwatch-comma.csv", lambda s: f"{(50 + s) // 60:02}:{(50 + s) % 60:02},0")
clocked("two-fields.csv", lambda s: f"{(50 + s) // 60:02}:{(50 + s) % 60:02}", "refused")
clocked("two-fields-said.csv", lambda s: f"{(50 + s) // 60:02}:{(50 + s) % 60:02}", "right", "Time (mm:ss)")
clocked("appended.csv", lambda s: s % 14, "refused", "Time (s)")
clocked("appended-odd.csv", lambda s: s if s < 14 else round(s - 14 + 0.1, 1), "refused", "Time (s)")
clocked("newest-first.csv", lambda s: s, "right", "Time (s)", ROWS[::-1])
clocked("sorted.csv", lambda s: s, "refused", "Time (s)", ROWS[::2] + ROWS[1::2])
text("steps-run.csv", lines([["Step", *NAMES], *[[1 if t < 14 else 2, t % 14, *r] for t, *r in ROWS]]), "either", SET, "--map",
     "Step=run,Time (s)=time:s,Speed (mm/s)=speed:mm/s,Load (N)=normal_force:N,Friction (N)=friction_force:N")
# Cells.
COF = [round(f / l, 4) for l, f in zip(LOAD, FRICTION)]
text("minus.csv", lines([NAMES, *ROWS]).replace("Friction (N)", "Fx (N)"), "right", SET)
text("thousands.csv", lines([["Time (s)", "Speed (mm/s)", "Load (mN)", "Friction (N)"],
                             *[[t, v, f"{l:.3f}".replace(".", ",") + ".0", f] for t, v, l, f in ROWS]], ";"), "either")
text("commas-in-commas.csv", lines([NAMES, *ROWS], ",", True), "refused")
# Words for peak to peak, bare letters.
for k, head in enumerate(["Amplitude (um p-p)", "Amplitude [um pp]", "peak-to-peak amplitude (um)", "Amplitude peak-peak (um)"]):
    text(f"stroke-{k}.csv", lines([[*NAMES, head], *[r + [0] for r in ROWS]]), "right", "direction=1")
text("bare-force.csv", lines([[*NAMES[:3], "F"], *ROWS]), "refused")
text("bare-amp.csv", lines([[*NAMES, "amp"], *[r + [1.5] for r in ROWS]]), "refused", "direction=1,frequency=27:kHz")
# Units that need a number.
text("rpm.csv", lines([["Time (s)", "n", "Load (N)", "Friction (N)"], *[[t, repr(60 * v / 20 / (2 * numpy.pi)), l, f] for t, v, l, f in ROWS]]),
     "right", SET, "--map", "Time (s)=time:s,n=speed:rpm@20mm,Load (N)=normal_force:N,Friction (N)=friction_force:N")
text("volts.csv", lines([["Time (s)", "Speed (mm/s)", "Load (V)", "Friction (V)"], *[[t, v, l / 4, f / 4] for t, v, l, f in ROWS]]),
     "right", SET, "--map", "Time (s)=time:s,Speed (mm/s)=speed:mm/s,Load (V)=normal_force:4N/V,Friction (V)=friction_force:4N/V")
text("torque.csv", lines([["Time (s)", "Speed (mm/s)", "Load (N)", "M"], *[[t, v, l, f / 50] for t, v, l, f in ROWS]]),
     "right", SET, "--map", "Time (s)=time:s,Speed (mm/s)=speed:mm/s,Load (N)=normal_force:N,M=friction_force:Nm@20mm")


# Workbooks.
def book(name, rows, expect="right", given=SET, *more, shape=lambda sheet: None):
    book = openpyxl.Workbook()
    for row in rows:
        book.active.append(row)
    shape(book.active)
    book.save(f"{folder}/{name}")
    tell(name, expect, given, *more)


def percent(sheet):
    for row in sheet.iter_rows(min_row=2, min_col=4, max_col=4):
        row[0].number_format = "0.00 %"


book("book.xlsx", [NAMES, *ROWS])
book("book-units.xlsx", [["Specimen 3"], BARE + ["R"], UNITS + ["ohm"], *[r + [1.5] for r in ROWS]])
book("book-blocks.xlsx", [*first, [], ["Step 2"], [NAMES[k] for k in (3, 1, 0, 2)], *[[r[k] for k in (3, 1, 0, 2)] for r in second]])
book("book-formula.xlsx", [NAMES, *[[t, v, l, f"=C{k + 2}*0.4"] for k, (t, v, l, f) in enumerate(ROWS)]], "refused")
exact = [[t, v, l, c] for (t, v, l, _), c in zip(ROWS, COF)]
book("book-percent.xlsx", [[*NAMES[:3], "COF (%)"], *exact], "right", SET, shape=percent)
book("book-far.xlsx", [NAMES, *ROWS], "right", SET, shape=lambda sheet: sheet.cell(1048576, 16384, 1.0))
# Arrays.
arrays = {n: numpy.array([float(r[k]) for r in ROWS]) for k, n in enumerate(["t", "v", "Fn", "Ff"])}
MAP = ["--map", "t=time:s,v=speed:mm/s,Fn=normal_force:N,Ff=friction_force:N"]
beside = {"fit": numpy.array([1.0, 2.0]), "C": numpy.eye(6), "who": "somebody", "cells": numpy.array([1, "a"], dtype=object)}
scipy.io.savemat(f"{folder}/workspace.mat", {**arrays, **beside})
tell("workspace.mat", "right", SET, *MAP)
scipy.io.savemat(f"{folder}/longer.mat", {**arrays, **{f"r{k}": numpy.arange(99.0) for k in range(5)}})
tell("longer.mat", "right", SET, *MAP)
scipy.io.savemat(f"{folder}/units.mat", {**arrays, "units": {"t": "s", "v": "mm/s", "Fn": "N", "Ff": "N"}})
tell("units.mat", "right")
cells = numpy.empty(2, dtype=object)
cells[:] = [numpy.array(ROWS), numpy.array(ROWS)]
scipy.io.savemat(f"{folder}/cells.mat", {"runs": cells})
tell("cells.mat", "refused")
with h5py.File(f"{folder}/units.h5", "w") as out:
    for (name, values), unit, factor in zip(arrays.items(), ["ms", "um/s", "mN", "mN"], [1000, 1000, 1000, 1000]):
        out[f"entry/{name}"] = numpy.round(values * factor, 6)
        out[f"entry/{name}"].attrs["units"] = unit
    out["entry/C"] = numpy.eye(6)
    out["entry/who"] = "somebody"
tell("units.h5")
with h5py.File(f"{folder}/matrix.h5", "w") as out:
    out["data"] = numpy.array(ROWS)
    out["data"].attrs["columns"] = ["t", "v", "Fn", "Ff"]
    out["data"].attrs["units"] = UNITS
tell("matrix.h5")
with h5py.File(f"{folder}/packed.h5", "w") as out:
    for name, values in arrays.items():
        out[name] = numpy.round(values * 10000).astype("i4")
        out[name].attrs.update({"scale_factor": 1e-4, "units": dict(zip(arrays, UNITS))[name]})
tell("packed.h5", "either")
with h5py.File(f"{folder}/padded.h5", "w") as out:
    out["data"] = numpy.vstack([numpy.array(ROWS), numpy.zeros((40, 4))])
PAD = ["--map", "#1=time:s,#2=speed:mm/s,#3=normal_force:N,#4=friction_force:N"]
tell("padded.h5", "refused", SET, *PAD)
numpy.save(f"{folder}/matrix.npy", numpy.array(ROWS))
tell("matrix.npy", "right", SET, *PAD)
table = pyarrow.table({n: v for n, v in arrays.items()})
fields = [pyarrow.field(n, "float64", metadata={"unit": u}) for n, u in zip(arrays, ["s", "mm/s", "mN", "mN"])]
milli = [arrays["t"], arrays["v"], numpy.round(arrays["Fn"] * 1000), numpy.round(arrays["Ff"] * 1000, 1)]
table = pyarrow.table(milli, schema=pyarrow.schema(fields))
pyarrow.parquet.write_table(table, f"{folder}/units.parquet")
tell("units.parquet")
pyarrow.feather.write_feather(table, f"{folder}/units.arrow", compression="uncompressed")
tell("units.arrow")
