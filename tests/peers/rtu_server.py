"""An independent FT 300: a pymodbus RTU server on a serial line, registers put together by hand.

usage: rtu_server.py PORT FX FZ (hundredths of a newton)
"""
import asyncio
import sys

from pymodbus import FramerType
from pymodbus.server import ModbusSerialServer
from pymodbus.simulator import DataType, SimData, SimDevice


async def main():
    fx, fz = (int(x) & 0xFFFF for x in sys.argv[2:4])
    device = SimDevice(id=9, simdata=[
        SimData(180, values=[fx, 0, fz, 0, 0, 0], datatype=DataType.REGISTERS),
        SimData(514, values=[2019], datatype=DataType.REGISTERS),
    ])
    server = ModbusSerialServer(device, framer=FramerType.RTU, port=sys.argv[1], baudrate=19200)
    await server.serve_forever(background=True)
    print("ready", flush=True)
    await asyncio.Event().wait()


asyncio.run(main())
