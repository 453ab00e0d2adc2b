"""A two-axis strain-gauge amplifier behind Modbus TCP, in plain sockets: floats in input registers, low word first. It takes a sample
every 2 ms. Prints the port once it listens.

usage: sick_sensor.py AILMENT
healthy    small noise about zero
nan        no number, and a status that says so
swapped    high word first, where the profile says low word first
far        what a wrong type makes of it: -3721 N
frozen     the same forces, while its counter runs on
slow       one new sample a second
bad        every fifth answer is an exception: some 100 a second
saturated  at the end of its range
pressed    -0.8 N stand on the normal axis
noisy      a noise of 0.2 N
millinewtons   forces in mN where newtons are stated
"""
import random
import socket
import socketserver
import struct
import sys
import time

AILMENT = sys.argv[1]
CHANCE = random.Random(1)


def words(kind, value):
    high, low = struct.unpack(">HH", struct.pack(kind, value))
    return [low, high]


def noisy(mean, sd):
    return mean + CHANCE.gauss(0.0, sd)


class Sensor:
    def __init__(self):
        self.count = -1

    def registers(self):
        now = time.monotonic()
        count = int(now if AILMENT == "slow" else now * 500) & 0xFFFFFFFF
        if count != self.count:
            self.count = count
            self.sample()
        if AILMENT == "swapped":
            pairs = [words(">f", self.lateral), words(">f", self.normal)]
            return [*pairs[0][::-1], *pairs[1][::-1], *words(">I", count), self.status, 4242]
        return [*words(">f", self.lateral), *words(">f", self.normal), *words(">I", count), self.status, 4242]

    def sample(self):
        self.status = 0
        self.lateral, self.normal = noisy(0.002, 1e-3), noisy(-0.001, 1e-3)
        if AILMENT == "nan":
            self.lateral = self.normal = float("nan")
            self.status = 2
        elif AILMENT == "far":
            self.lateral = noisy(-3721.0, 0.5)
        elif AILMENT == "frozen":
            self.lateral, self.normal = 0.0017, -0.0004
        elif AILMENT == "saturated":
            self.lateral = 10.5 + abs(noisy(0.0, 1e-3))
        elif AILMENT == "pressed":
            self.normal = noisy(-0.8, 1e-3)
        elif AILMENT == "noisy":
            self.lateral = noisy(0.0, 0.2)
        elif AILMENT == "millinewtons":
            self.lateral, self.normal = 1e3 * self.lateral, 1e3 * self.normal


SENSOR = Sensor()


class Handler(socketserver.BaseRequestHandler):
    def handle(self):
        try:
            self.answer()
        except ConnectionError:
            pass

    def answer(self):
        self.request.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        answers = 0
        while True:
            head = self.whole(8)
            if head is None:
                return
            transaction, _, length, unit, function = struct.unpack(">HHHBB", head)
            body = self.whole(length - 2)
            if body is None:
                return
            answers += 1
            if function == 4 and not (AILMENT == "bad" and answers % 5 == 0):
                start, count = struct.unpack(">HH", body)
                data = struct.pack(f">{count}H", *SENSOR.registers()[start:start + count])
                reply = struct.pack(">BB", function, len(data)) + data
            elif function == 16:
                reply = struct.pack(">B", function) + body[:4]
            else:
                reply = struct.pack(">BB", function | 0x80, 4)
            self.request.sendall(struct.pack(">HHHB", transaction, 0, len(reply) + 1, unit) + reply)

    def whole(self, count):
        data = b""
        while len(data) < count:
            more = self.request.recv(count - len(data))
            if not more:
                return None
            data += more
        return data


class Server(socketserver.ThreadingTCPServer):
    daemon_threads = True
    allow_reuse_address = True


with Server(("127.0.0.1", 0), Handler) as server:
    print(server.server_address[1], flush=True)
    server.serve_forever()
