"""An independent Zaber X-LSM on a serial line: the ASCII protocol of firmware 7, by pyserial. It moves in real time.

A line on standard input is its warning flag from now on. usage: zaber_stage.py PORT
"""
import re
import sys
import threading
import time

import serial

flag, alerts, position, velocity, since = "WR", 1, 100_000.0, 0.0, time.monotonic()


def listen():
    global flag
    for line in sys.stdin:
        flag = line.strip()


def now():
    """Microsteps; velocities are in 1/1.6384 of one a second."""
    return position + velocity / 1.6384 * (time.monotonic() - since)


threading.Thread(target=listen, daemon=True).start()
line = serial.Serial(sys.argv[1], 115200)
print("ready", flush=True)
while True:
    asked = line.read_until(b"\n").decode().strip()
    if asked == "":
        continue
    state = "OK"
    if asked == "/1 set comm.alert 0":
        alerts, data = 0, "0"
    elif asked == "/1 get pos":
        data = f"{now():.0f}"
    elif asked == "/1 get vel":
        data = f"{velocity:.0f}"
    elif told := re.fullmatch(r"/1 (?:move vel (-?\d+)|stop)", asked):
        wanted = float(told[1] or 0)
        if abs(wanted) > 3_500_000:
            state, data = "RJ", "BADDATA"
        else:
            position, since, velocity = now(), time.monotonic(), wanted
            data = "0"
    else:
        state, data = "RJ", "BADCOMMAND"
    busy = "BUSY" if velocity else "IDLE"
    line.write(f"@01 0 {state} {busy} {flag} {data}\r\n".encode())
    if alerts:
        line.write(b"!01 0 IDLE --\r\n")
