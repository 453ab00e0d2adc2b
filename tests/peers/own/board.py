"""A board that sends by itself on a serial line, 250 frames a second with floats and a CRC by crccheck. usage: board.py PORT RIG_PORT"""
import os
import struct
import sys
import time

import serial
from crccheck.crc import Crc16Mcrf4XX as CrcMcrf4XX
from rig import Faults, Forces

faults = Faults()
forces = Forces(sys.argv[2], faults)
line = serial.Serial(sys.argv[1], 460800)
print("ready", flush=True)
count, due, waiting = 0, time.monotonic(), []
while True:
    fault = faults.now
    if fault != "repeated":
        count = (count + 1) % 65536
    lateral, normal = (float("nan"),) * 2 if fault == "nan" else forces.shown()
    if fault == "rail":
        lateral = 6.0
    body = struct.pack("<HffB", count, lateral, normal, 2 if fault == "supply" else 0)
    check = CrcMcrf4XX.calc(body) ^ (1 if fault == "wrong-crc" else 0)
    frame = b"\xaa\x55" + body + struct.pack("<H", check)
    frame = {"silence": b"", "garbage": os.urandom(len(frame)), "half": frame[: len(frame) // 2]}.get(fault, frame)
    if fault == "lost" and count % 60:
        frame = b""
    if fault == "late":
        waiting.append(frame)
        frame = b""
    elif waiting:
        frame, waiting = b"".join(waiting) + frame, []
    if fault == "closed":
        line.close()
        time.sleep(0.2)
        sys.exit(0)
    line.write(frame)
    due = max(due + 0.004, time.monotonic() - 0.1)
    time.sleep(max(0.0, due - time.monotonic()))
