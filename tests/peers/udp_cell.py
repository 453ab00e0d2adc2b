"""An independent Net F/T: it streams records over UDP to whoever asks with 1234h, command 2; or lines of text to a port.

usage: udp_cell.py rdt FX_N FZ_N | udp_cell.py lines PORT LATERAL_MN NORMAL_MN
"""
import socket
import struct
import sys
import time

kind = sys.argv[1]
sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
sock.bind(("127.0.0.1", 0))
if kind == "rdt":
    fx, fz = (round(float(x) * 1e6) for x in sys.argv[2:4])
    print(sock.getsockname()[1], flush=True)
    while True:
        request, client = sock.recvfrom(100)
        if struct.unpack(">HHI", request) == (0x1234, 2, 0):
            break
else:
    client, (lateral, normal) = ("127.0.0.1", int(sys.argv[2])), sys.argv[3:5]
    print(sock.getsockname()[1], flush=True)
count = 0
while True:
    count += 1
    if kind == "rdt":
        # Now and then a record is lost, one comes twice, and a short one comes that is none.
        if count % 50 != 7:
            record = struct.pack(">III6i", count, 2 * count, 0, fx, 0, fz, 0, 0, 0)
            sock.sendto(record, client)
            if count % 50 == 9:
                sock.sendto(record, client)
        if count % 50 == 11:
            sock.sendto(b"short", client)
    else:
        sock.sendto(f"{lateral};{normal}".encode(), client)
    time.sleep(0.002)
