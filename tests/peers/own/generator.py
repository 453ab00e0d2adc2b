"""A generator with lines of text that drives the virtual rig's amplifier: level in per mille, frequency in Hz. It has no watchdog.

usage: generator.py PORT RIG_PORT
"""
import os
import re
import struct
import sys
import threading
import time

import serial
from rig import Faults, Rig

faults = Faults()
rig = Rig(sys.argv[2])
state = {"level": 0.0, "freq": 27500.0, "out": "off"}


def drive():
    beat = 0
    while True:
        beat = (beat + 1) % 65536
        on = state["out"] == "on" and faults.now != "drops"
        # 1000 per mille are 10 um peak-to-peak.
        level = round(state["level"] * 10)
        rig.write(2, 100, struct.pack(">HIHH", level, round(state["freq"] * 10), int(on), beat))
        time.sleep(0.01)


def answer(asked):
    if asked == "ID?":
        return "US-GEN 3"
    if asked == "ST?":
        fault = faults.now
        level = state["level"] + (300 if fault == "jump" else 0)
        level = "nan" if fault == "nan" else f"{level:.1f}"
        return f"level={level} freq={state['freq']:.2f} out={state['out']} temp={31.5:.1f}"
    if faults.now == "refused":
        return "ERR 17"
    told = re.fullmatch(r"(level|freq|out) (\S+)", asked)
    if told is None:
        return "ERR 1"
    if faults.now != "deaf":
        state[told[1]] = told[2] if told[1] == "out" else float(told[2])
    return "ok"


threading.Thread(target=drive, daemon=True).start()
line = serial.Serial(sys.argv[1], 115200)
print("ready", flush=True)
before = "ok"
while True:
    raw = line.read_until(b"\n")
    asked = raw.decode(errors="replace").strip()
    if asked == "":
        continue
    whole = (answer(asked) + "\r\n").encode()
    fault = faults.now
    if fault == "closed":
        line.close()
        # Pulled out, it goes on as it was told last: only the switch in its supply is left.
        threading.Event().wait()
    if fault == "late":
        time.sleep(0.35)
    if fault == "alarm":
        whole = b"!ALARM 2A\r\n" + whole
    if fault == "out-of-step":
        whole, before = before if isinstance(before, bytes) else b"ok\r\n", whole
    sent = {"silence": b"", "garbage": os.urandom(len(whole)).replace(b"\n", b"?") + b"\r\n", "echo": raw, "half": whole[:6]}
    line.write(sent.get(fault, whole))
