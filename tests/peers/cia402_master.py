"""python-canopen as the master of an emulated CiA 402 drive, node 5, over a serial CAN adapter; prints JSON.

usage: cia402_master.py PORT
"""
import json
import struct
import sys
import threading
import time

import canopen
from cia402_objects import dictionary

network = canopen.Network()
network.connect(interface="slcan", channel=sys.argv[1], bitrate=1000000, sleep_after_open=0.1)
node = network.add_node(5, dictionary())
node.sdo.RESPONSE_TIMEOUT = 3.0
process_data, arrived = [], threading.Event()


def heard(_identifier, data, _time):
    process_data.append(struct.unpack("<Hhi", data))
    arrived.set()


network.subscribe(0x185, heard)
said = {"before": node.nmt.wait_for_heartbeat(5), "device_type": node.sdo[0x1000].raw,
        "vendor": node.sdo[0x1018][1].raw, "states": [node.sdo[0x6041].raw & 0x6F]}
node.sdo[0x6060].raw = 3
said["mode"] = node.sdo[0x6061].raw
node.sdo[0x6083].raw = 123456
said["acceleration"] = node.sdo[0x6083].raw
try:
    node.sdo[0x60FF].raw = 1
except canopen.SdoAbortedError as error:
    said["refused"] = error.code
said["silent_before_start"] = not process_data
node.nmt.state = "OPERATIONAL"
assert arrived.wait(5), "no process data"
for control in (6, 7, 15):
    network.send_message(0x205, struct.pack("<Hi", control, 0))
    said["states"].append(node.sdo[0x6041].raw & 0x6F)
network.send_message(0x205, struct.pack("<Hi", 15, -20000))
said["after"] = node.nmt.wait_for_heartbeat(5)
said["status"], said["velocity"], said["position"] = process_data[0]
# The master falls silent: the drive's own guard must trip, say so, and stay in its fault.
emergency = node.emcy.wait(timeout=5)
said["emergency"] = emergency and emergency.code
said["error_code"] = node.sdo[0x603F].raw
said["fault"] = node.sdo[0x6041].raw & 0x4F
node.sdo[0x6040].raw = 15
said["still_fault"] = node.sdo[0x6041].raw & 0x4F
node.sdo[0x6040].raw = 0x80
said["reset"] = node.sdo[0x6041].raw & 0x4F
print(json.dumps(said))
network.disconnect()
