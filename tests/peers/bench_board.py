"""An independent microcontroller board on a serial line: frames by struct, the check by crccheck.

It sends what it is told, or what a Modbus server (the virtual rig's force instrument) measures.
usage: bench_board.py PORT LATERAL_MN NORMAL_MN | bench_board.py PORT MODBUS_PORT
"""
import struct
import sys
import time

import serial
from crccheck.crc import CrcXmodem
from pymodbus.client import ModbusTcpClient

line = serial.Serial(sys.argv[1], 115200)
if len(sys.argv) == 4:
    still = [round(float(x) * 100) for x in sys.argv[2:4]]

    def measure():
        return still
else:
    rig = ModbusTcpClient("127.0.0.1", port=int(sys.argv[2]))
    assert rig.connect()

    def measure():
        words = rig.read_holding_registers(6, count=4, device_id=1).registers
        # 1e-5 N a count there, 0.01 mN here.
        return struct.unpack(">ii", struct.pack(">4H", *words))


print("ready", flush=True)
count, due = 0, time.monotonic()
while True:
    lateral, normal = measure()
    body = struct.pack("<HiiB", count, lateral, normal, 0)
    line.write(b"\xa5\x5a" + body + CrcXmodem.calcbytes(body, byteorder="big"))
    count = (count + 1) % 65536
    due += 0.002
    time.sleep(max(0.0, due - time.monotonic()))
