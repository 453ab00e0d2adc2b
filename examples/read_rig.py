"""A foreign controller in a few lines: it starts the virtual rig, reads its force sensor over Modbus TCP, and ends it.

Needs `pip install muprime pymodbus`. Usage: python read_rig.py [PATH OF MUPRIME]
"""

import json
import struct
import subprocess
import sys
import time

from pymodbus.client import ModbusTcpClient

muprime = sys.argv[1] if len(sys.argv) > 1 else "muprime"
command = [muprime, "--json", "virtual-rig", "--setup", "virtual-ideal", "--modbus-tcp", "127.0.0.1:0", "--seed", "3"]
with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as rig:
    try:
        host, _, port = json.loads(rig.stdout.readline())["modbus_tcp"].rpartition(":")
        client = ModbusTcpClient(host, port=int(port))
        assert client.connect()
        for _ in range(5):
            # Unit 1 is the force sensor; `muprime doc profile muprime-force2` explains its registers.
            registers = client.read_holding_registers(0, count=12, device_id=1).registers
            _, sample, _, lateral, normal = struct.unpack_from(">IIIii", struct.pack(">12H", *registers))
            print(f"sample {sample}: lateral {lateral * 1e-2:+.2f} mN, normal {normal * 1e-2:+.2f} mN")
            time.sleep(0.05)
        client.close()
    finally:
        rig.terminate()
