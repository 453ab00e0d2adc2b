"""An independent strain-gauge amplifier: a pymodbus TCP server, floats in input registers, low word first.

It gives forces only once its filter was set. Prints the port once it listens.
usage: strain_amp.py LATERAL_N NORMAL_N
"""
import asyncio
import struct
import sys
import time

from pymodbus.server import ModbusTcpServer
from pymodbus.simulator import DataType, SimData, SimDevice


def words(kind, value):
    high, low = struct.unpack(">HH", struct.pack(kind, value))
    return [low, high]


async def main():
    lateral, normal = (float(x) for x in sys.argv[1:3])
    settings = [0, 9]

    async def action(function, _start, address, _count, registers, values):
        if function == 16 and address == 100:
            settings[: len(values)] = values
        if function == 4:
            status = 0 if settings == [3, 0] else 8
            sample = int(time.monotonic() * 1000) & 0xFFFFFFFF
            registers[0:8] = [*words(">f", lateral), *words(">f", normal), *words(">I", sample), status, 4242]
        return None

    blocks = [SimData(0, values=[0] * 8, datatype=DataType.REGISTERS),
              SimData(100, values=settings, datatype=DataType.REGISTERS)]
    server = ModbusTcpServer(SimDevice(id=7, simdata=blocks, action=action), address=("127.0.0.1", 0))
    await server.serve_forever(background=True)
    print(server.transport.sockets[0].getsockname()[1], flush=True)
    await asyncio.Event().wait()


asyncio.run(main())
