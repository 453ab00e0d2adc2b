"""An independent generator on a serial line, by pyserial: lines with names, several values, alarms with a number.

A line on standard input is an alarm to be raised with every answer; an empty one ends it. What it is told goes to the file.
usage: ascii_generator.py PORT LOG
"""
import re
import sys
import threading

import serial

state = {"F": 27500.0, "AMP": 12.5, "OUT": "OFF"}
alarm = ""


def listen():
    global alarm
    for line in sys.stdin:
        alarm = line.strip()


threading.Thread(target=listen, daemon=True).start()
line = serial.Serial(sys.argv[1], 115200)
log = open(sys.argv[2], "w", buffering=1)
print("ready", flush=True)
while True:
    asked = line.read_until(b"\r\n").decode().strip()
    if asked == "":
        continue
    if asked == "*IDN?":
        answer = "TRIBOGEN,1,0"
    elif asked == "STATE?":
        status = 0x00A1
        answer = "F={F:.1f}Hz,AMP={AMP:.1f}%,OUT={OUT},S=".format(**state) + f"{status:04X}"
    else:
        log.write(asked + "\n")
        told = re.fullmatch(r"(F|AMP)=([0-9.]+)%?|OUT=(ON|OFF)", asked)
        if told is None:
            answer = "?"
        else:
            answer = "OK"
            if told[1]:
                state[told[1]] = float(told[2])
            else:
                state["OUT"] = told[3]
    if alarm:
        line.write(f"ALARM {alarm}\r\n".encode())
    line.write((answer + "\r\n").encode())
