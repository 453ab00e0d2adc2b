"""python-can over a serial adapter: answers each frame with its data turned round and the next identifier.

usage: slcan_echo.py PORT
"""
import sys

import can

with can.Bus(interface="slcan", channel=sys.argv[1], bitrate=1000000, sleep_after_open=0.1) as bus:
    print("ready", flush=True)
    while True:
        message = bus.recv(30)
        if message is None:
            break
        bus.send(can.Message(arbitration_id=message.arbitration_id + 1, data=bytes(reversed(message.data)),
                             is_extended_id=message.is_extended_id))
