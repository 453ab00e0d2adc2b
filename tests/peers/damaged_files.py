"""Files of every reader, damaged: damaged_files.py FOLDER MUPRIME COUNT writes the dialects of foreign_dialects.py, COUNT damaged copies of
them, and prints what importing each of those costs, as import_costs.py does.
"""
import os
import random
import subprocess
import sys

folder, program, count = sys.argv[1:]
here = os.path.dirname(__file__)
whole, damaged = f"{folder}/whole", f"{folder}/damaged"
os.mkdir(whole)
os.mkdir(damaged)
subprocess.run([sys.executable, f"{here}/foreign_dialects.py", whole], check=True, stdout=subprocess.DEVNULL)
kinds = {}
for name in sorted(os.listdir(whole)):
    kinds.setdefault(os.path.splitext(name)[1], []).append(name)
draw = random.Random(39)


def cut(data):
    return data[: draw.randrange(len(data))]


def flip(data):
    data = bytearray(data)
    for _ in range(draw.choice([1, 4, 64])):
        data[draw.randrange(len(data))] = draw.randrange(256)
    return bytes(data)


def huge(data):
    at, size = draw.randrange(len(data)), draw.choice([2, 4, 8])
    value = draw.choice([b"\xff" * size, b"\x7f" + b"\xff" * (size - 1), b"\xff" * (size - 1) + b"\x7f", b"\0" * size])
    return data[:at] + value + data[at + size :]


def again(data):
    start = draw.randrange(len(data))
    piece = data[start : start + draw.randrange(1, 400)]
    at = draw.randrange(len(data))
    return data[:at] + piece * draw.choice([1, 1, 1000]) + data[at:]


def digits(data):
    at = [k for k, byte in enumerate(data) if chr(byte).isdigit()]
    if not at:
        return flip(data)
    k = draw.choice(at)
    return data[:k] + draw.choice([b"9" * 40, b"1e999", b"-", b"nan", b"1e-400", b"\xd9\xa3"]) + data[k + 1 :]


# Each ending as often as any other: texts are most of the dialects, and the least likely to break a reader.
for k in range(int(count)):
    ending = sorted(kinds)[k % len(kinds)]
    name = draw.choice(kinds[ending])
    with open(f"{whole}/{name}", "rb") as source:
        data = source.read()
    data = draw.choice([cut, flip, huge, again, digits])(data)
    with open(f"{damaged}/{k:04}-{name}", "wb") as out:
        out.write(data)
os.execv(sys.executable, [sys.executable, f"{here}/import_costs.py", damaged, program, "--set", "amplitude_pp_m=0,direction=1"])
