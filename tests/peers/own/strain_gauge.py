"""A strain-gauge amplifier: Modbus TCP, input registers, floats with the low word first. usage: strain_gauge.py RIG_PORT"""
import os
import socket
import struct
import sys
import threading
import time

from rig import Faults, Forces

faults = Faults()
forces = Forces(sys.argv[1], faults)
filters = []
count = 0


def swapped(value):
    high, low = struct.unpack(">HH", struct.pack(">f", value))
    return struct.pack(">HH", low, high)


def registers():
    global count
    if faults.now != "repeated":
        count = int(time.monotonic() * 1000) & 0xFFFF
    lateral, normal = (float("nan"),) * 2 if faults.now == "nan" else forces.shown()
    status = 0 if filters == [4] else 1
    return swapped(lateral) + swapped(normal) + struct.pack(">HHH", count, status, 0x5347)


def answer(request):
    transaction, _, _, unit, function, address, number = struct.unpack(">HHHBBHH", request[:12])
    if function == 16:
        filters[:] = struct.unpack(f">{number}H", request[13 : 13 + 2 * number])
        pdu = struct.pack(">BHH", 16, address, number)
    elif function == 4 and address + number <= 7:
        data = registers()[2 * address : 2 * (address + number)]
        pdu = struct.pack(">BB", 4, len(data)) + data
    else:
        pdu = struct.pack(">BB", function | 0x80, 2)
    fault = faults.now
    if fault == "refused":
        pdu = struct.pack(">BB", function | 0x80, 4)
    if fault == "wrong-unit":
        unit ^= 3
    whole = struct.pack(">HHHB", transaction, 0, len(pdu) + 1, unit) + pdu
    if fault == "late":
        time.sleep(0.4)
    return {"silence": b"", "garbage": os.urandom(len(whole)), "echo": request, "half": whole[: len(whole) // 2]}.get(
        fault, whole
    )


def serve(client):
    client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    came = b""
    while part := client.recv(260):
        came += part
        while len(came) >= 6 and len(came) >= 6 + struct.unpack(">H", came[4:6])[0]:
            length = 6 + struct.unpack(">H", came[4:6])[0]
            if faults.now == "closed":
                break
            client.sendall(answer(came[:length]))
            came = came[length:]
        if faults.now == "closed":
            break
    client.close()


def quiet(client):
    try:
        serve(client)
    except OSError:
        pass


server = socket.create_server(("127.0.0.1", 0))
print(server.getsockname()[1], flush=True)
while True:
    threading.Thread(target=quiet, args=(server.accept()[0],), daemon=True).start()
