"""An independent LabJack T7: a pymodbus TCP server with the registers of the public Modbus map.

It answers with -9999 until range, inputs and resolution were set. Prints the port once it listens.
usage: labjack_t7.py AIN0_V AIN2_V
"""
import asyncio
import struct
import sys

from pymodbus.server import ModbusTcpServer
from pymodbus.simulator import DataType, SimData, SimDevice


def words(value):
    return list(struct.unpack(">HH", struct.pack(">f", value)))


async def main():
    ain0, ain2 = (float(x) for x in sys.argv[1:3])
    settings = {}

    async def action(function, _start, address, count, registers, values):
        if function == 16:
            settings[address] = list(values)
            return None
        if function == 3 and address < 100:
            ready = settings == {43900: words(10.0), 43902: [1], 43903: [1]}
            volts = {0: ain0, 4: ain2} if ready else {}
            for channel in range(0, 28, 2):
                registers[channel : channel + 2] = words(volts.get(channel, -9999.0))
            # A channel nobody wants takes time to convert: reading it is a fault of the client's.
            assert address in (0, 4) and count == 2, (address, count)
        return None

    def block(address, values):
        return SimData(address, values=values, datatype=DataType.REGISTERS)

    blocks = [block(0, [0] * 28), block(43900, [0] * 4), block(60000, words(7.0))]
    server = ModbusTcpServer(SimDevice(id=1, simdata=blocks, action=action), address=("127.0.0.1", 0))
    await server.serve_forever(background=True)
    print(server.transport.sockets[0].getsockname()[1], flush=True)
    await asyncio.Event().wait()


asyncio.run(main())
