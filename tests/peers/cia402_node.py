"""A CiA 402 drive by python-canopen: node 5 with its own state machine, over a serial CAN adapter.

Reports velocity -200 (hundreds of counts/s) and position 12345 counts, 1000 more while it is enabled.
usage: cia402_node.py PORT
"""
import struct
import sys
import time

import canopen
from cia402_objects import dictionary

DISABLED, READY, ON, ENABLED = 0x0240, 0x0221, 0x0223, 0x0227
network = canopen.Network()
network.connect(interface="slcan", channel=sys.argv[1], bitrate=1000000, sleep_after_open=0.1)
node = network.create_node(5, dictionary())
status, mode = DISABLED, 0


def obey(control):
    """CiA 402, the transitions of the power state machine; no step may be left out."""
    global status
    if not control & 0x02:
        status = DISABLED
    elif control & 0x07 == 0x06:
        status = READY
    elif control & 0x0F == 0x07 and status != DISABLED:
        status = ON
    elif control & 0x0F == 0x0F and status == ON:
        status = ENABLED


def written(index, data, **_):
    global mode
    if index == 0x6040:
        obey(int.from_bytes(data, "little"))
    elif index == 0x6060:
        mode = data[0]


node.add_write_callback(written)
node.add_read_callback(lambda index, **_: {0x6041: status, 0x6061: mode}.get(index))
network.subscribe(0x205, lambda _id, data, _time: obey(struct.unpack("<Hi", data)[0]))
node.nmt.state = "PRE-OPERATIONAL"
node.nmt.start_heartbeat(50)
print("ready", flush=True)
while True:
    if node.nmt.state == "OPERATIONAL":
        network.send_message(0x185, struct.pack("<Hhi", status, -200, 12345 + 1000 * (status == ENABLED)))
    time.sleep(0.005)
