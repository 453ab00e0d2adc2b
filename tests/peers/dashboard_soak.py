"""Two sweeps at once on two virtual rigs of their own, in wall-clock time at 1 kHz: one with a dashboard and eight browsers' worth of
streams (six that read, a slow one, one that reads nothing, and one more that comes and goes), one without. Prints a table of both.

    dashboard_soak.py MUPRIME SECONDS

A sweep that a stall of the machine trips goes on in its folder until the time is over; trips are counted. Ends with 1 where a row was
lost, a browser that reads was let go, or the resident memory grew by more than 16 MiB.
"""

import base64
import json
import os
import re
import socket
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

MUPRIME, SECONDS = sys.argv[1], float(sys.argv[2])
FOLDER = Path(tempfile.mkdtemp(prefix="dashboard-soak-"))
PLAN = FOLDER / "soak.toml"
PLAN.write_text(
    'name = "soak"\nseed = 11\nreference_every = 8\nreplicates = 400\n[pass]\nsettle_s = 0.4\nmeasure_s = 0.6\n'
    "[base]\namplitude_pp_m = 2e-6\nfrequency_hz = 27500\nspeed_m_s = 0.01\nnormal_force_n = 0.25\n"
    "[[series]]\namplitude_pp_m = [0.5e-6, 1e-6, 2e-6, 3e-6, 2.5e-6, 1.5e-6]\n"
)
UNTIL = time.monotonic() + SECONDS


class Sweep:
    """One of the two: runs until the time is over, and adds up what its sessions say."""

    def __init__(self, name, dashboard):
        self.name, self.dashboard, self.link = name, dashboard, None
        self.out = FOLDER / "runs" / name
        self.reports, self.outcomes, self.resident = [], [], []
        self.process = None
        self.thread = threading.Thread(target=self.run)
        self.thread.start()

    def run(self):
        while UNTIL - time.monotonic() > 5:
            words = [MUPRIME, "run", str(PLAN), "--setup", "virtual-ideal", "--out", str(self.out)]
            words += ["--dashboard=127.0.0.1:0"] if self.dashboard else []
            environment = dict(os.environ, MUPRIME_RUNS=str(FOLDER / "runs"))
            self.process = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, env=environment)
            threading.Thread(target=self.watch, args=(self.process,), daemon=True).start()
            for line in self.process.stdout:
                found = re.search(r"http://\S+", line)
                self.link = found.group(0) if found else self.link
            self.process.wait()
            self.link = None
            summary = self.out / "summary.json"
            if not summary.exists():
                continue
            told = json.loads(summary.read_text())
            self.outcomes.append(told["outcome"] if told["outcome"] != "tripped" else told["cause"])
            self.reports.append(told["loop_report"] | {"record_lost": told.get("record_lost", 0)})

    def watch(self, process):
        asked = False
        while process.poll() is None:
            try:
                status = Path(f"/proc/{process.pid}/status").read_text()
                found = re.search(r"VmRSS:\s+(\d+)", status)
                if found:
                    self.resident.append((time.monotonic(), int(found.group(1)) * 1024))
            except OSError:
                pass
            if time.monotonic() > UNTIL and not asked:
                process.terminate()
                asked = True
            time.sleep(1)


def stream(link, run):
    address, token = re.match(r"http://([^/]+)/#token=(\S+)", link).groups()
    host, port = address.rsplit(":", 1)
    peer = socket.create_connection((host, int(port)), timeout=30)
    key = base64.b64encode(os.urandom(16)).decode()
    peer.sendall(
        f"GET /api/live/{run} HTTP/1.1\r\nHost: {address}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
        f"Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: {key}\r\nSec-WebSocket-Protocol: muprime, {token}\r\n\r\n".encode()
    )
    head = b""
    while not head.endswith(b"\r\n\r\n"):
        byte = peer.recv(1)
        if not byte:
            raise OSError("closed")
        head += byte
    if not head.startswith(b"HTTP/1.1 101"):
        raise OSError(head.decode(errors="replace").splitlines()[0])
    return peer


told = {"bytes": 0, "opened": 0, "let_go": 0, "slow_bytes": 0, "deaf_opened": 0, "came_again": 0}


def client(sweep, kind):
    """Comes again for as long as the sweep goes on."""
    while time.monotonic() < UNTIL:
        link = sweep.link
        if link is None:
            time.sleep(0.2)
            continue
        try:
            peer = stream(link, sweep.name)
        except OSError:
            time.sleep(0.5)
            continue
        came = time.monotonic()
        told["deaf_opened" if kind == "deaf" else "came_again" if kind == "comes" else "opened"] += 1
        try:
            while time.monotonic() < UNTIL and sweep.link == link:
                if kind == "deaf":
                    time.sleep(0.5)
                    continue
                if kind == "comes" and time.monotonic() - came > 20:
                    break
                part = peer.recv(512 if kind == "slow" else 1 << 16)
                if not part:
                    # The end of a session closes its streams; anything else let a reader go.
                    time.sleep(1)
                    told["let_go"] += sweep.link == link and kind in ("reads", "comes")
                    break
                told["slow_bytes" if kind == "slow" else "bytes"] += len(part)
                time.sleep(0.2 if kind == "slow" else 0)
        except OSError:
            pass
        peer.close()


watched, alone = Sweep("watched", True), Sweep("alone", False)
kinds = ["reads"] * 6 + ["slow", "deaf", "comes"]
clients = [threading.Thread(target=client, args=(watched, kind), daemon=True) for kind in kinds]
for one in clients:
    one.start()
for sweep in (watched, alone):
    sweep.thread.join()

print("| sweep | cycles | deadlines missed | rows lost | lateness us 50, 90, 99, 99.9 %, worst | sessions ended by |")
print("|---|---|---|---|---|---|")
lost = 0
for sweep in (watched, alone):
    add = lambda key: sum(report[key] for report in sweep.reports)
    counts, worst = {}, 0
    for report in sweep.reports:
        worst = max(worst, report["lateness_ns"][4])
        for bound, count in report["histogram"]:
            counts[bound] = counts.get(bound, 0) + count
    total, quantiles = sum(counts.values()), []
    for share in (0.5, 0.9, 0.99, 0.999):
        so_far = 0
        for bound in sorted(counts):
            so_far += counts[bound]
            if so_far >= share * total:
                quantiles.append(f"below {(bound + 1) / 1000:.0f}")
                break
    missing = add("ring_drops") + add("record_lost")
    lost += missing
    ends = ", ".join(f"{sweep.outcomes.count(o)} {o}" for o in sorted(set(sweep.outcomes)))
    print(f"| {sweep.name} | {add('cycles')} | {add('overruns')} | {missing} | {', '.join(quantiles)}, {worst / 1000:.0f} | {ends} |")
early = [b for t, b in watched.resident if t < UNTIL - 0.75 * SECONDS]
late = [b for t, b in watched.resident if t > UNTIL - 0.25 * SECONDS]
print(f"streams: {told}; resident bytes of the watched one: {max(early)} in the first quarter, {max(late)} in the last")
sys.exit(bool(lost or told["let_go"] or max(late) > max(early) + (16 << 20)))
