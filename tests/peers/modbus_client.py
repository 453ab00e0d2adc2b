"""An independent client: reads and writes the virtual rig's registers with pymodbus, and prints JSON.

usage: modbus_client.py PORT
"""
import json
import struct
import sys

from pymodbus.client import ModbusTcpClient

client = ModbusTcpClient("127.0.0.1", port=int(sys.argv[1]))
assert client.connect()
force = client.read_holding_registers(0, count=12, device_id=1)
magic, counter, micros, lateral, normal, status, _ = struct.unpack(">IIIiiHH", struct.pack(">12H", *force.registers))
written = client.write_registers(100, list(struct.unpack(">5H", struct.pack(">HIHH", 1500, 300000, 1, 5))), device_id=2)
drive = client.read_holding_registers(6, count=4, device_id=2)
amplitude, frequency = struct.unpack(">II", struct.pack(">4H", *drive.registers))
print(json.dumps({
    "magic": magic, "counter": counter, "micros": micros, "lateral": lateral, "normal": normal, "status": status,
    "written": not written.isError(), "echo_amplitude": amplitude, "echo_frequency": frequency,
    "beyond_the_end": client.read_holding_registers(0, count=13, device_id=1).exception_code,
    "out_of_range": client.write_registers(100, [20001, 0, 0, 0, 0], device_id=2).exception_code,
    "no_such_unit": client.read_holding_registers(0, count=1, device_id=99).exception_code,
    "write_to_a_reading": client.write_register(0, 1, device_id=1).exception_code,
}))
client.close()
