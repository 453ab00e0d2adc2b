"""Independent Modbus RTU clients: pymodbus and minimalmodbus in turn on one serial line; prints JSON.

Unit 9 is a Robotiq FT 300, unit 2 the virtual rig's amplifier.
usage: rtu_client.py PORT BAUD
"""
import json
import sys

import minimalmodbus
from pymodbus.client import ModbusSerialClient

port, baud = sys.argv[1], int(sys.argv[2])
said = {}

with ModbusSerialClient(port, baudrate=baud, timeout=2) as client:
    said["pymodbus"] = client.read_holding_registers(180, count=6, device_id=9).registers
    said["pymodbus_written"] = not client.write_registers(100, [1500, 4, 37856, 1, 5], device_id=2).isError()
    said["pymodbus_out_of_range"] = client.write_registers(100, [20001, 0, 0, 0, 0], device_id=2).exception_code
    said["pymodbus_no_such_register"] = client.read_holding_registers(300, count=2, device_id=9).exception_code

sensor = minimalmodbus.Instrument(port, 9, close_port_after_each_call=True)
sensor.serial.baudrate, sensor.serial.timeout = baud, 2
said["minimalmodbus"] = [sensor.read_register(180 + i, signed=True) for i in range(6)]
said["minimalmodbus_n"] = sensor.read_register(180, number_of_decimals=2, signed=True)
amplifier = minimalmodbus.Instrument(port, 2, close_port_after_each_call=True)
amplifier.serial.baudrate, amplifier.serial.timeout = baud, 2
said["echo_amplitude"] = amplifier.read_long(6)
amplifier.write_registers(100, [1250, 4, 37856, 1, 6])
said["echo_after_minimalmodbus"] = amplifier.read_long(6)
try:
    sensor.read_registers(300, 2)
except minimalmodbus.IllegalRequestError as error:
    said["minimalmodbus_no_such_register"] = str(error)
print(json.dumps(said))
