"""pyvisa, then pymeasure's own driver of the series, as clients of the emulated generator; prints JSON.

usage: scpi_client.py PORT
"""
import json
import sys

import pyvisa
from pymeasure.instruments.agilent import Agilent33500

manager = pyvisa.ResourceManager("@py")
generator = manager.open_resource(f"TCPIP::127.0.0.1::{sys.argv[1]}::SOCKET")
generator.read_termination = generator.write_termination = "\n"
generator.timeout = 5000
assert generator.query("*IDN?").startswith("Agilent Technologies,335")
for line in ("OUTP1:LOAD INF", "SOUR1:VOLT:UNIT VPP", "SOUR1:FUNC SIN", "SOUR1:FREQ 27500.5", "SOUR1:VOLT 1.25", "OUTP1 1"):
    generator.write(line)
    assert generator.query("SYST:ERR?").startswith("+0,"), line
generator.write("SOUR1:NONSENSE 3")
unknown = generator.query("SYST:ERR?")
said = {
    "frequency": float(generator.query("SOUR1:FREQ?")), "amplitude": float(generator.query("SOUR1:VOLT?")),
    "output": bool(float(generator.query("OUTP1?"))), "unknown": unknown,
}
generator.close()

driver = Agilent33500(f"TCPIP::127.0.0.1::{sys.argv[1]}::SOCKET", visa_library="@py",
                      read_termination="\n", write_termination="\n", timeout=5000)
channel = driver.ch_1
said["pymeasure_found"] = [channel.frequency, channel.amplitude, channel.output]
channel.output = False
channel.shape = "SIN"
channel.frequency = 31000.25
channel.amplitude = 0.75
said["pymeasure_set"] = [channel.frequency, channel.amplitude, channel.output]
said["pymeasure_errors"] = driver.ask("SYST:ERR?")
# As it was found, for whoever looks next.
channel.frequency, channel.amplitude, channel.output = said["pymeasure_found"]
print(json.dumps(said))
