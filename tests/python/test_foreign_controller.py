"""A laboratory's own controller, in Python with pymodbus, tested against the virtual rig: a small sweep, a defect, a watchdog.

It knows nothing of muprime but the registers that `muprime doc profile` prints.
"""

import struct
import threading
import time

import pytest
from pymodbus.client import ModbusTcpClient

FORCE, AMPLIFIER, STAGE = 1, 2, 3


class Controller:
    """Keeps the heartbeats going, moves the stage to and fro, and means forces."""

    def __init__(self, host: str, port: int) -> None:
        self.client = ModbusTcpClient(host, port=port, timeout=2)
        assert self.client.connect()
        self.lock, self.over, self.beat = threading.Lock(), threading.Event(), 0
        self.pulse = threading.Thread(target=self._beat)
        self.pulse.start()

    def _beat(self) -> None:
        while not self.over.is_set():
            self.beat = (self.beat + 1) % 65536
            for unit in (AMPLIFIER, STAGE):
                self.write(unit, 104, struct.pack(">H", self.beat))
            time.sleep(0.005)

    def write(self, unit: int, register: int, data: bytes) -> None:
        words = list(struct.unpack(f">{len(data) // 2}H", data))
        with self.lock:
            assert not self.client.write_registers(register, words, device_id=unit).isError()

    def read(self, unit: int, count: int) -> bytes:
        with self.lock:
            answer = self.client.read_holding_registers(0, count=count, device_id=unit)
        assert not answer.isError()
        return struct.pack(f">{count}H", *answer.registers)

    def drive(self, amplitude_pp_m: float, frequency_hz: float = 27.5e3) -> None:
        on = amplitude_pp_m > 0
        self.write(AMPLIFIER, 100, struct.pack(">HIH", round(amplitude_pp_m * 1e9), round(frequency_hz * 10), on))

    def slide(self, velocity_m_s: float, load_n: float) -> None:
        self.write(STAGE, 100, struct.pack(">iI", round(velocity_m_s * 1e9), round(load_n * 1e6)))

    def output_on(self) -> bool:
        return bool(struct.unpack_from(">H", self.read(AMPLIFIER, 20), 30)[0] & 1)

    def friction(self, seconds: float) -> float:
        """Mean lateral over mean normal force."""
        lateral, normal, until = [], [], time.monotonic() + seconds
        while time.monotonic() < until:
            left, down = struct.unpack_from(">ii", self.read(FORCE, 12), 12)
            lateral.append(left * 1e-5)
            normal.append(down * 1e-5)
        return abs(sum(lateral) / sum(normal))

    def mu_relative(self, amplitude_pp_m: float) -> float:
        """One pass to the right without vibration, one to the left with it."""
        found = []
        for velocity, amplitude in ((0.02, 0.0), (-0.02, amplitude_pp_m)):
            # Where this machine held the heartbeat up for 50 ms, the amplifier has switched itself off: the pass is made again.
            for _ in range(10):
                self.drive(0.0)
                self.drive(amplitude)
                self.slide(velocity, 0.25)
                time.sleep(0.3)
                friction = self.friction(0.4)
                whole = self.output_on() == (amplitude > 0)
                velocity = -velocity
                if whole:
                    break
            found.append(friction)
        self.drive(0.0)
        self.slide(0.0, 0.0)
        return found[1] / found[0]

    def close(self) -> None:
        self.over.set()
        self.pulse.join()
        self.client.close()


@pytest.fixture
def controller():
    opened = []

    def connect(rig):
        opened.append(Controller(*rig.modbus_tcp))
        return opened[-1]

    yield connect
    for one in opened:
        one.close()


def test_friction_falls_as_the_spring_slider_says(virtual_rig, controller):
    bench = controller(virtual_rig(seed=3))
    found = [bench.mu_relative(w) for w in (1e-6, 2e-6, 4e-6)]
    # Eqs. 6-15 at 27.5 kHz, 20 mm/s, 0.25 N: 0.461, 0.296, 0.191. A finger's stiffnesses scatter by 5 %.
    for mu, expected in zip(found, (0.461, 0.296, 0.191)):
        assert mu == pytest.approx(expected, rel=0.15), found


def test_two_rigs_at_once_and_a_defect_shows(virtual_rig, controller):
    weak = virtual_rig(seed=3, defects='[[defect]]\nname = "amplitude_miscalibration"\nparameters = { factor = 0.5 }\n')
    sound = virtual_rig(seed=3)
    assert weak.modbus_tcp != sound.modbus_tcp
    assert controller(weak).mu_relative(2e-6) > 1.3 * controller(sound).mu_relative(2e-6)


def test_the_amplifier_switches_off_where_the_heartbeat_stops(virtual_rig, controller):
    bench = controller(virtual_rig())
    bench.drive(2e-6)
    time.sleep(0.2)
    assert bench.output_on()
    bench.over.set()
    bench.pulse.join()
    time.sleep(0.3)
    assert not bench.output_on()


def test_a_defect_that_is_none_is_refused(virtual_rig):
    with pytest.raises(ValueError, match="gravity"):
        virtual_rig(defects='[[defect]]\nname = "gravity"\n')
