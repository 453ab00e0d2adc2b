"""A force sensor on CAN behind a serial adapter (slcan): message 1A1h, big endian, status and counter, 200 a second.

usage: can_force.py PORT RIG_PORT
"""
import os
import struct
import sys
import time

import serial
from rig import Faults, Forces

faults = Faults()
forces = Forces(sys.argv[2], faults)
line = serial.Serial(sys.argv[1], 115200, timeout=0)
print("ready", flush=True)
count, open_, due, waiting = 0, False, time.monotonic(), []
while True:
    try:
        for byte in line.read(100):
            if byte in b"OC":
                open_ = byte == ord("O")
            if byte == 13:
                line.write(b"\r")
    except serial.SerialException:
        pass
    fault = faults.now
    if fault != "repeated":
        count = (count + 1) % 256
    lateral, normal = (round(force * 1e4) for force in forces.shown())
    status = 4 if fault == "nan" else 0
    data = struct.pack(">BBhh", count, status, lateral, normal)
    head = {"wrong-identifier": "t1A2", "wrong-kind": "T000001A1"}.get(fault, "t1A1")
    if fault == "short":
        data = data[:4]
    frame = f"{head}{len(data)}{data.hex().upper()}\r".encode()
    frame = {
        "silence": b"",
        "closed": b"",
        "garbage": os.urandom(len(frame)).replace(b"t", b"u").replace(b"T", b"U"),
        "half": frame[: len(frame) // 2],
        "bell": b"\x07",
    }.get(fault, frame)
    if fault == "lost" and count % 50:
        frame = b""
    if fault == "late":
        waiting.append(frame)
        frame = b""
    elif waiting:
        frame, waiting = b"".join(waiting) + frame, []
    if open_ and frame:
        line.write(frame)
    if fault == "closed" and line.is_open:
        # The adapter is pulled: the program that holds the other end sees it go.
        line.close()
        time.sleep(0.2)
        sys.exit(0)
    due = max(due + 0.005, time.monotonic() - 0.1)
    time.sleep(max(0.0, due - time.monotonic()))
