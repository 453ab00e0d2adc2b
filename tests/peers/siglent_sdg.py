"""An independent Siglent SDG2042X: lines over TCP as its programming guide has them. Set-points are not answered.

Prints the port; what it is told goes to the file.
usage: siglent_sdg.py LOG
"""
import re
import socketserver
import sys

wave = {"WVTP": "SQUARE", "FRQ": 1000.0, "AMP": 4.0}
output = {"on": "OFF", "load": "50"}


def number(value):
    return f"{value:.6g}"


class Generator(socketserver.StreamRequestHandler):
    def handle(self):
        for raw in self.rfile:
            line = raw.decode().strip()
            if line == "*IDN?":
                self.say("Siglent Technologies,SDG2042X,SDG2XCA0000001,2.01.01.35R3B2")
            elif line == "C1:BSWV?":
                f, a = wave["FRQ"], wave["AMP"]
                self.say(
                    f"C1:BSWV WVTP,{wave['WVTP']},FRQ,{number(f)}HZ,PERI,{number(1 / f)}S,AMP,{number(a)}V,"
                    f"AMPVRMS,{number(a / 2**1.5)}Vrms,MAX_OUTPUT_AMP,20V,OFST,0V,"
                    f"HLEV,{number(a / 2)}V,LLEV,{number(-a / 2)}V,PHSE,0"
                )
            elif line == "C1:OUTP?":
                self.say(f"C1:OUTP {output['on']},LOAD,{output['load']},PLRT,NOR")
            elif line:
                log.write(line + "\n")
                if told := re.fullmatch(r"C1:BSWV (WVTP|FRQ|AMP),(\S+)", line):
                    wave[told[1]] = told[2] if told[1] == "WVTP" else float(told[2])
                elif told := re.fullmatch(r"C1:OUTP (ON|OFF)", line):
                    output["on"] = told[1]
                elif line == "C1:OUTP LOAD,HZ":
                    output["load"] = "HZ"

    def say(self, line):
        self.wfile.write((line + "\n").encode())


log = open(sys.argv[1], "w", buffering=1)
socketserver.ThreadingTCPServer.allow_reuse_address = True
with socketserver.ThreadingTCPServer(("127.0.0.1", 0), Generator) as server:
    print(server.server_address[1], flush=True)
    server.serve_forever()
