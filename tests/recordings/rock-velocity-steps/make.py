#!/usr/bin/env python3
"""Makes sepiolite.csv and basalt.csv from the two whole records.

usage: make.py FOLDER   with FOLDER/velstep3_TR2_exp013_sepiolite.txt and FOLDER/velstep4_BRAVA_expb819_basalt.txt, which
README.md says where to find. The tables are written beside this script.

Each record is one step of the sliding velocity. Windows of equal length lie end to end over the last part of the record
before the step and over its last part after it; a window is a pass.
"""
import pathlib
import sys

AREA_M2 = 1e-8  # chosen: 20 to 30 MPa on it are the loads of a fingertip, 0.2 to 0.3 N

# Record, table, time of the step in s, seconds before and after it that are taken, seconds of a window.
RECORDS = [
    ("velstep3_TR2_exp013_sepiolite.txt", "sepiolite.csv", 21318.0, 600.0, 600.0, 30.0),
    ("velstep4_BRAVA_expb819_basalt.txt", "basalt.csv", 11676.0, 60.0, 40.0, 5.0),
]


def windows(rows, end, span, length):
    """Rows of each window of the `span` seconds before `end`, from the first one on."""
    count = round(span / length)
    for i in range(count):
        start = end - span + i * length
        yield [row for row in rows if start <= row[0] < start + length]


def slope(xs, ys):
    """Least squares of y on x."""
    mx, my = sum(xs) / len(xs), sum(ys) / len(ys)
    return sum((x - mx) * (y - my) for x, y in zip(xs, ys)) / sum((x - mx) ** 2 for x in xs)


def main():
    source, here = pathlib.Path(sys.argv[1]), pathlib.Path(__file__).parent
    for record, table, step, before, after, length in RECORDS:
        lines = (source / record).read_text().splitlines()[1:]
        rows = [tuple(map(float, line.split())) for line in lines]
        taken = list(windows(rows, step - 1.0, before, length)) + list(windows(rows, rows[-1][0], after, length))
        out = ["point,time_s,amplitude_pp_m,speed_m_s,direction,normal_force_n,lateral_force_n"]
        for point, window in enumerate(taken):
            time, _, friction, stress = (list(column) for column in zip(*window))
            speed = slope(time, [row[1] * 1e-6 for row in window])
            load = sum(stress) / len(stress) * 1e6 * AREA_M2
            force = sum(friction) / len(friction) * load
            out.append(f"{point},{time[0] - rows[0][0]:.3f},0,{speed:.5g},1,{load:.6f},{force:.7f}")
        (here / table).write_text("\n".join(out) + "\n")


if __name__ == "__main__":
    main()
