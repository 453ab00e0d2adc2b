"""An independent client of an ATI Digital F/T on a serial line: pymodbus for the calibration, pyserial for the maker's
own functions and the stream. Prints JSON.

usage: ati_digital.py PORT BAUD
"""
import json
import struct
import sys
import time

import serial
from pymodbus.client import ModbusSerialClient

UNIT, CALIBRATION = 10, 0x00E3
path, baud = sys.argv[1], int(sys.argv[2])
said = {}


def crc(data):
    value = 0xFFFF
    for byte in data:
        value ^= byte
        for _ in range(8):
            value = (value >> 1) ^ 0xA001 if value & 1 else value >> 1
    return struct.pack("<H", value)


with ModbusSerialClient(path, baudrate=baud, timeout=2) as client:
    registers = []
    for start, count in ((0, 64), (64, 64), (128, 40)):  # more than 125 cannot be read at once
        answer = client.read_holding_registers(CALIBRATION + start, count=count, device_id=UNIT)
        registers += [None] * count if answer.isError() else answer.registers
    for start, count in ((32, 72), (104, 29)):
        registers[start:start + count] = client.read_holding_registers(
            CALIBRATION + start, count=count, device_id=UNIT).registers
    said["active"] = client.read_holding_registers(0, count=12, device_id=UNIT).registers
    said["calibration"] = registers[121:133]
    said["locked"] = client.write_registers(0, [1] * 12, device_id=UNIT).exception_code

matrix = struct.unpack(">36f", struct.pack(">72H", *registers[32:104]))
counts = struct.unpack(">2i", struct.pack(">4H", *registers[117:121]))
port = serial.Serial(path, baud, timeout=1)
start = bytes([UNIT, 0x46, 0x55])
said["start"] = (start + crc(start)).hex()
port.write(start + crc(start))
answer = port.read(5)
said["started"] = answer[:3].hex() if answer[3:] == crc(answer[:3]) else "bad"
began = time.monotonic()
stream = port.read(13 * 2000)
said["samples_per_s"] = 2000 / (time.monotonic() - began)
said["bad_sums"] = sum(sum(stream[i:i + 12]) & 0x7F != stream[i + 12] & 0x7F for i in range(0, len(stream), 13))
forces = [0.0] * 6
for i in range(0, len(stream), 13):
    g0, g2, g4, g1, g3, g5 = struct.unpack(">6h", stream[i:i + 12])
    gages = (g0, g1, g2, g3, g4, g5)
    for axis in range(6):
        row = matrix[6 * axis:6 * axis + 6]
        forces[axis] += sum(m * g for m, g in zip(row, gages)) / counts[axis // 3] * 13 / len(stream)
said["forces"] = forces
port.write(bytes(72))
time.sleep(0.5)
port.reset_input_buffer()
said["silent"] = port.read(1) == b""
print(json.dumps(said))
