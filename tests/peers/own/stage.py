"""A stage on Modbus RTU that moves and loads the virtual rig's: unit 9, CRC by crccheck. usage: stage.py PORT RIG_PORT

Holding registers: 200 position (i32, 0.1 um), 202 velocity (i32, um/s), 204 status; 300 velocity (i32, um/s), 302 load (mN).
"""
import os
import struct
import sys
import threading
import time

import serial
from crccheck.crc import CrcModbus
from rig import Faults, Rig

faults = Faults()
rig = Rig(sys.argv[2])
wanted = {"velocity": 0, "load": 0}
shown = (0, 0)


def move():
    """Follows what was told last, and keeps the virtual stage's own watchdog fed: nothing but a stop stops it."""
    global shown
    beat = 0
    while True:
        beat = (beat + 1) % 65536
        rig.write(3, 100, struct.pack(">iIH", wanted["velocity"] * 1000, wanted["load"] * 1000, beat))
        position, velocity = struct.unpack(">ii", rig.read(3, 6, 4))
        if faults.now != "frozen":
            shown = (position // 100, velocity // 1000)
        time.sleep(0.005)


def answer(request):
    unit, function, address, number = struct.unpack(">BBHH", request[:6])
    if function == 3 and address == 200 and number == 5:
        position, velocity = shown
        if faults.now == "shift":
            position += 300_000
        if faults.now == "jump":
            position += 3_000_000
        status = 1 if faults.now == "fault" else 0
        body = struct.pack(">BBB", unit, 3, 10) + struct.pack(">iiH", position, velocity, status)
    elif function == 16 and address == 300 and number == 3 and faults.now != "refused":
        if faults.now != "deaf":
            wanted["velocity"], wanted["load"] = struct.unpack(">iH", request[7:13])
        body = request[:6]
    else:
        body = struct.pack(">BBB", unit, function | 0x80, 4)
    if faults.now == "wrong-unit":
        body = bytes([unit ^ 1]) + body[1:]
    check = CrcModbus.calc(body) ^ (0x0101 if faults.now == "wrong-crc" else 0)
    return body + struct.pack("<H", check)


threading.Thread(target=move, daemon=True).start()
line = serial.Serial(sys.argv[1], 115200, timeout=0.02)
print("ready", flush=True)
came = b""
while True:
    part = line.read(1)
    came = came + part + line.read(line.in_waiting) if part else b""
    length = 8 if came[1:2] == b"\x03" else 15
    if len(came) < length:
        continue
    request, came = came[:length], b""
    if request[0] != 9 or CrcModbus.calc(request[:-2]) != struct.unpack("<H", request[-2:])[0]:
        continue
    whole, fault = answer(request), faults.now
    if fault == "closed":
        line.close()
        threading.Event().wait()
    if fault == "late":
        time.sleep(0.35)
    sent = {"silence": b"", "garbage": os.urandom(len(whole)), "echo": request, "half": whole[: len(whole) // 2]}
    line.write(sent.get(fault, whole))
