"""Attacks a dashboard as a foreign page, a rebound name, a flood and a broken client do.

    attack.py HOST:PORT TOKEN RUN

Prints one JSON document: `accepted`, every attack that got more than a refusal, which should be none, and how many of each kind there were.
"""
import base64
import json
import os
import socket
import struct
import sys
import time

place, token, run = sys.argv[1:4]
host, port = place.rsplit(":", 1)
accepted, counts = [], {}


def connect():
    return socket.create_connection((host, int(port)), timeout=5)


def said(sock, most=65536):
    """What is answered, until the other end closes or says nothing for a second."""
    sock.settimeout(1)
    got = b""
    try:
        while len(got) < most:
            more = sock.recv(4096)
            if not more:
                break
            got += more
            if b"\r\n\r\n" in got and b"101" in got.split(b"\r\n", 1)[0]:
                break
    except OSError:
        pass
    return got


def status(request):
    try:
        with connect() as sock:
            sock.sendall(request)
            first = said(sock).split(b"\r\n", 1)[0].split()
            return int(first[1]) if len(first) > 1 else 0
    except OSError:
        return 0


def ask(what="stop", method="POST", address=None, lines=None, body=None):
    body = json.dumps({"ask": what}).encode() if body is None else body
    address = address or f"/api/runs/{run}/ask"
    given = {"Host": place, "Authorization": f"Bearer {token}", "Content-Type": "application/json", "Content-Length": str(len(body)), "Connection": "close"}
    for name, value in (lines or {}).items():
        if value is None:
            given.pop(name)
        else:
            given[name] = value
    head = "".join(f"{n}: {v}\r\n" for n, v in given.items())
    return f"{method} {address} HTTP/1.1\r\n{head}\r\n".encode() + body


def stream(lines=None, protocols=None, address=None):
    given = {"Host": place, "Upgrade": "websocket", "Connection": "Upgrade", "Sec-WebSocket-Version": "13", "Sec-WebSocket-Key": base64.b64encode(os.urandom(16)).decode(), "Sec-WebSocket-Protocol": protocols or f"muprime, {token}"}
    for name, value in (lines or {}).items():
        if value is None:
            given.pop(name)
        else:
            given[name] = value
    head = "".join(f"{n}: {v}\r\n" for n, v in given.items())
    return f"GET {address or f'/api/live/{run}'} HTTP/1.1\r\n{head}\r\n".encode()


def tried(kind, request, allowed=()):
    counts[kind] = counts.get(kind, 0) + 1
    got = status(request)
    if got and got < 400 and got not in allowed:
        accepted.append(f"{kind}: {got} for {request[:160]!r}")


evil = ["evil.example", f"evil.example:{port}", "127.0.0.1", "127.0.0.1:1", f"127.0.0.1.evil.example:{port}", f"{place}.", f"{place}@evil.example", "", f"[::ffff:127.0.0.1]:{port}", f"2130706433:{port}", f"0.0.0.0:{port}", f"{place}, evil.example"]
for name in evil:
    tried("host", ask(lines={"Host": name}))
    tried("host", stream({"Host": name}))
    tried("host", stream({"Host": name}, "foxglove.sdk.v1", f"/foxglove?token={token}"))
    tried("host", f"GET / HTTP/1.1\r\nHost: {name}\r\nConnection: close\r\n\r\n".encode())
tried("host", ask().replace(b"Host:", b"Host: evil.example\r\nHost:", 1))
tried("host", ask(lines={"Host": None}))
tried("host", ask(address=f"http://evil.example/api/runs/{run}/ask", lines={"Host": "evil.example"}))
for origin in ["http://evil.example", "null", "https://" + place, f"http://evil.example:{port}", f"http://{place}.evil.example", f"http://127.0.0.1:{int(port) + 1}", "file://", f"http://{place}/", f"http://{place} http://evil.example"]:
    tried("origin", ask(lines={"Origin": origin}))
    tried("origin", stream({"Origin": origin}))
    tried("origin", stream({"Origin": origin}, "foxglove.sdk.v1", f"/foxglove?token={token}"))
    tried("origin", f"GET /metrics?token={token} HTTP/1.1\r\nHost: {place}\r\nOrigin: {origin}\r\nConnection: close\r\n\r\n".encode())
    tried("origin", ask("stop", "OPTIONS", lines={"Origin": origin, "Access-Control-Request-Method": "POST"}, body=b""))
wrong = ["", "0" * 64, token[:-1], token + "0", token.upper() if token.upper() != token else "x", token[::-1], "Bearer", "null", "undefined"]
for one in wrong:
    tried("token", ask(lines={"Authorization": f"Bearer {one}"}))
    tried("token", ask(lines={"Authorization": one}))
    tried("token", stream(protocols=f"muprime, {one}" if one else "muprime"))
    tried("token", stream(protocols="foxglove.sdk.v1", address=f"/foxglove?token={one}"))
    tried("token", f"GET /metrics?token={one} HTTP/1.1\r\nHost: {place}\r\nConnection: close\r\n\r\n".encode())
tried("token", ask(lines={"Authorization": None}))
tried("token", ask(lines={"Authorization": None, "Cookie": f"token={token}"}))
tried("token", ask(lines={"Authorization": None}, address=f"/api/runs/{run}/ask?token={token}"))
tried("token", ask(lines={"Authorization": f"Basic {base64.b64encode(token.encode()).decode()}"}))
tried("token", stream({"Sec-WebSocket-Protocol": None}))
tried("token", stream(protocols=token))
for address in ["/api/runs", "/api/about", f"/api/runs/{run}", f"/api/runs/{run}/report", f"/api/runs/{run}/files/points.csv", f"/api/runs/{run}/pages/report.html", f"/api/compare?runs={run}/{run}", f"/api/runs?token={token}", f"/api/runs/{run}/files/points.csv?token={token}", "/metrics"]:
    tried("token", f"GET {address} HTTP/1.1\r\nHost: {place}\r\nConnection: close\r\n\r\n".encode())
# What writes has the same guard, and takes no more than its bounds.
noted = b'{"tags":["x"],"note":"y"}'
for what, body in [("annotations", noted), ("diagnose", b"{}")]:
    address = f"/api/runs/{run}/{what}"
    tried("token", ask(lines={"Authorization": None}, address=address, body=body))
    tried("host", ask(lines={"Host": "evil.example"}, address=address, body=body))
    tried("origin", ask(lines={"Origin": "http://evil.example"}, address=address, body=body))
    tried("method", ask(method="GET", address=address, body=b""))
for body in [b"", b"{", b'{"tags":"x"}', b'{"path":"/etc/passwd"}', b'{"note":"' + b"x" * 2001 + b'"}', b'{"note":"' + b"x" * 40000 + b'"}', b'{"tags":["a,b"]}']:
    tried("body", ask(address=f"/api/runs/{run}/annotations", body=body))
# Reads change nothing, and nothing but a known word is passed on.
for method in ["GET", "HEAD", "PUT", "DELETE", "PATCH", "TRACE"]:
    tried("method", ask(method=method))
for body in [b"", b"stop", b"{}", b'{"ask":"arm"}', b'{"ask":"reset"}', b'{"ask":["stop"]}', b'{"ask":"stop","limit":1}', b'{"ask":"STOP"}', b"\xff\xfe", b'{"ask":"stop"' + b" " * 300 + b"}", b"{" * 200]:
    tried("body", ask(body=body))
tried("body", ask(lines={"Content-Type": "text/plain"}))
tried("body", ask(lines={"Content-Type": "application/x-www-form-urlencoded"}, body=b"ask=stop"))
for what in ["pause", "resume"]:
    tried("control", ask(what))
for name in ["..", "%2e%2e", "..%2f..%2fetc", "%2Fetc%2Fpasswd", "nothing", "a%00b", "x" * 5000]:
    tried("path", ask(address=f"/api/runs/{name}/ask"))
    tried("path", stream(address=f"/api/live/{name}"))
    tried("path", ask(method="GET", address=f"/api/runs/{run}/pages/{name}", body=b""))
tried("path", ask(method="GET", address=f"/api/runs/{run}/pages/points.csv", body=b""))
for name in ["..", "..%2fover%2fpoints.csv", "%2Fetc%2Fpasswd", "nothing", "sessions.jsonl", "a%00b"]:
    tried("path", ask(method="GET", address=f"/api/runs/{run}/files/{name}", body=b""))
    tried("path", ask(address=f"/api/runs/{name}/annotations", body=noted))
tried("path", ask(method="GET", address=f"/api/runs/{run}/pages/..%2f{run}%2freport.html", body=b""))
tried("head", b"GET / HTTP/1.1\r\nHost: " + place.encode() + b"\r\nX: " + b"x" * 100000 + b"\r\n\r\n")
tried("head", b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03" + os.urandom(200))


def frame(code, payload, final=True):
    head = bytes([(0x80 if final else 0) | code])
    n = len(payload)
    head += bytes([0x80 | n]) if n < 126 else bytes([0xFE]) + struct.pack(">H", n) if n < 65536 else bytes([0xFF]) + struct.pack(">Q", n)
    return head + b"\0\0\0\0" + payload


# A stream that was rightly opened and then says what it has no business to say: it is closed, and nothing comes of it.
talk = [frame(1, b"stop"), frame(1, b'{"ask":"stop"}'), frame(2, os.urandom(200)), frame(1, b"x" * (10 << 20)), frame(1, b"x" * 100, False) * 50, bytes([0x81, 0x84]) + b"\0\0\0\0" + b"\xff\xfe\xfd\xfc", bytes([0xF1, 0x80, 0, 0, 0, 0]), frame(9, b"x" * 125) * 2000]
for saying in talk:
    counts["stream"] = counts.get("stream", 0) + 1
    with connect() as sock:
        sock.sendall(stream())
        if b"101" not in said(sock).split(b"\r\n", 1)[0]:
            accepted.append("stream: a right one was refused")
            continue
        try:
            sock.settimeout(5)
            sock.sendall(saying)
            if saying[0] != 0x89:
                end = time.time() + 15
                while sock.recv(65536):
                    if time.time() > end:
                        accepted.append(f"stream: still open after {saying[:40]!r}")
                        break
        except OSError:
            pass

# A flood of connections that say nothing, and some that say their head one letter a second.
flood = []
for n in range(1000):
    try:
        sock = connect()
        if n % 2:
            sock.sendall(b"G")
        flood.append(sock)
    except OSError:
        pass
counts["connections"] = 1000
time.sleep(1)
open_now = 0
for sock in flood:
    sock.settimeout(0.001)
    try:
        open_now += sock.recv(1) != b""
    except TimeoutError:
        open_now += 1
    except OSError:
        pass
# They are let go after the time that a head may take, and then a person is served again.
served, began = 0, time.time()
while not served and time.time() - began < 40:
    served = status(f"GET /api/about HTTP/1.1\r\nHost: {place}\r\nAuthorization: Bearer {token}\r\nConnection: close\r\n\r\n".encode()) == 200
    time.sleep(0.5)
again = time.time() - began
for sock in flood:
    sock.close()
# Rightful asks by the hundred: those beyond the bound are refused.
answers = [status(ask("pause")) for _ in range(60)]
print(json.dumps({"accepted": accepted, "counts": counts, "open_at_once": open_now, "served_again_after_s": round(again, 1) if served else None, "too_many": answers.count(429)}))
