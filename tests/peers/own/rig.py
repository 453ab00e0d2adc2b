"""What the five emulators share: the virtual rig behind them, reached as a Modbus TCP client of nothing but bytes, and the fault
that a line on standard input names; an empty line ends it."""
import socket
import struct
import sys
import threading
import time


class Rig:
    def __init__(self, port):
        self.socket = socket.create_connection(("127.0.0.1", int(port)))
        self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.lock = threading.Lock()

    def ask(self, unit, pdu):
        with self.lock:
            self.socket.sendall(struct.pack(">HHHB", 1, 0, len(pdu) + 1, unit) + pdu)
            head = self.take(7)
            return self.take(struct.unpack(">H", head[4:6])[0] - 1)

    def take(self, count):
        came = b""
        while len(came) < count:
            part = self.socket.recv(count - len(came))
            if not part:
                sys.exit(0)
            came += part
        return came

    def read(self, unit, address, count):
        return self.ask(unit, struct.pack(">BHH", 3, address, count))[2:]

    def write(self, unit, address, data):
        self.ask(unit, struct.pack(">BHHB", 16, address, len(data) // 2, len(data)) + data)

    def forces(self):
        """Lateral and normal force in N."""
        return tuple(count * 1e-5 for count in struct.unpack(">ii", self.read(1, 6, 4)))


class Faults:
    def __init__(self):
        self.now = ""
        threading.Thread(target=self.listen, daemon=True).start()

    def listen(self):
        for line in sys.stdin:
            self.now = line.strip()


class Forces:
    """The newest forces, from a thread of their own; as they were when a fault froze them."""

    def __init__(self, port, faults):
        self.faults, rig = faults, Rig(port)
        self.newest = self.held = rig.forces()
        threading.Thread(target=self.follow, args=(rig,), daemon=True).start()

    def follow(self, rig):
        while True:
            self.newest = rig.forces()
            if self.faults.now != "frozen":
                self.held = self.newest
            time.sleep(0.002)

    def shown(self):
        lateral, normal = self.held
        return (lateral + 2.5 if self.faults.now == "jump" else lateral), normal
