"""An independent FT 300: a pymodbus RTU server on a serial line, registers put together by hand.

usage: rtu_server.py PORT FX FZ [FX FZ ...] (hundredths of a newton; a further unit from 10 on for each further pair)
"""
import asyncio
import sys

from pymodbus import FramerType
from pymodbus.server import ModbusSerialServer
from pymodbus.simulator import DataType, SimData, SimDevice


async def main():
    counts = [int(x) & 0xFFFF for x in sys.argv[2:]]
    devices = [SimDevice(id=9 + unit, simdata=[
        SimData(180, values=[fx, 0, fz, 0, 0, 0], datatype=DataType.REGISTERS),
        SimData(514, values=[2019], datatype=DataType.REGISTERS),
    ]) for unit, (fx, fz) in enumerate(zip(counts[::2], counts[1::2]))]
    server = ModbusSerialServer(devices, framer=FramerType.RTU, port=sys.argv[1], baudrate=19200)
    await server.serve_forever(background=True)
    print("ready", flush=True)
    await asyncio.Event().wait()


asyncio.run(main())
