"""An independent force instrument: a pymodbus server that replays a recorded friction trace.

Holds the registers of `muprime-force2` (12 holding registers of unit 1), put together here by hand from
the profile's text, not by this project's code. Prints the port once it listens.
usage: replay_server.py RECORDING ROWS_PER_SECOND
"""
import asyncio
import struct
import sys
import time

from pymodbus.server import ModbusTcpServer
from pymodbus.simulator import DataType, SimData, SimDevice

NORMAL_FORCE_N = 0.25
NEWTON_PER_COUNT = 1e-5


def counts(path):
    """(lateral, normal) in counts, row by row."""
    rows = [[float(x) for x in line.split()] for line in open(path) if not line.startswith("Time")]
    first_stress = rows[0][3]
    for _time, _displacement, friction, stress in rows:
        normal = NORMAL_FORCE_N * stress / first_stress
        yield round(friction * normal / NEWTON_PER_COUNT), round(normal / NEWTON_PER_COUNT)


async def main():
    trace = list(counts(sys.argv[1]))
    rate = float(sys.argv[2])
    first_read = None

    async def action(_function, start, _address, _count, registers, _values):
        nonlocal first_read
        if start != 0:
            return None
        if first_read is None:
            first_read = time.monotonic()
        row = min(int((time.monotonic() - first_read) * rate), len(trace) - 1)
        lateral, normal = trace[row]
        packed = struct.pack(">IIIiiHH", 0x6D753246, row, int(row / rate * 1e6), lateral, normal, 0, 0)
        registers[0:12] = struct.unpack(">12H", packed)
        return None

    device = SimDevice(id=1, simdata=[SimData(0, values=[0] * 12, datatype=DataType.REGISTERS)], action=action)
    server = ModbusTcpServer(device, address=("127.0.0.1", 0))
    await server.serve_forever(background=True)
    print(server.transport.sockets[0].getsockname()[1], flush=True)
    await asyncio.Event().wait()


asyncio.run(main())
