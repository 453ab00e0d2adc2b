"""What foreign programs make of the live streams.

    streams.py equal RUN CLIENT.json      messages of a Foxglove client against the run's export, read by the public `mcap` package
    streams.py metrics ADDRESS TOKEN DASHBOARD.json    /metrics by the public parser, and the names that a Grafana dashboard uses
"""

import bisect
import json
import re
import sys
import urllib.request
from pathlib import Path


def equal(run, client):
    from mcap.reader import make_reader

    seen = json.loads(Path(client).read_text())
    schemas, curves, passes = {}, {}, {}
    with open(Path(run) / "signals.mcap", "rb") as stream:
        reader = make_reader(stream)
        for channel in reader.get_summary().channels.values():
            schema = reader.get_summary().schemas[channel.schema_id]
            schemas[channel.topic] = (schema.name, schema.encoding, json.loads(schema.data))
        for _, channel, message in reader.iter_messages():
            value = json.loads(message.data).get("value")
            curves.setdefault(channel.topic, []).append((message.log_time, value))
    live = {t["topic"]: (t["schemaName"], t["schemaEncoding"], json.loads(t["schema"])) for t in seen["topics"]}
    units = {topic: live[topic][2]["properties"].get("value", {}).get("unit") for topic in live}
    compared, differ = 0, []
    for topic, messages in seen["messages"].items():
        if topic == "/event":
            continue
        exported = curves.get(topic, [])
        if topic.startswith("/pass/"):
            # Their time is that of the state before them.
            held = [value for _, value in exported]
            told = [data["value"] for _, data in messages]
            passes[topic] = len(told)
            compared += len(told)
            if told != held[: len(told)]:
                differ.append((topic, told, held))
            continue
        times = [at for at, _ in exported]
        for at, data in messages:
            k = bisect.bisect_right(times, int(at)) - 1
            compared += 1
            if k < 0 or exported[k][1] != data["value"]:
                differ.append((topic, at, data, exported[k] if k >= 0 else None))
    print(json.dumps({
        "advertised_as_exported": live == schemas,
        "compared": compared,
        "topics": len(seen["messages"]),
        "passes": passes.get("/pass/point", 0),
        "events": len(seen["messages"].get("/event", [])),
        "units": units,
        "differ": differ[:5],
    }))


def scraped(address, headers, query=""):
    request = urllib.request.Request(f"http://{address}/metrics{query}", headers=headers)
    try:
        with urllib.request.urlopen(request) as answer:
            return answer.status, answer.headers["Content-Type"], answer.read().decode()
    except urllib.error.HTTPError as refused:
        return refused.code, None, ""


def metrics(address, token, dashboard):
    from prometheus_client.openmetrics.parser import text_string_to_metric_families

    bearer = {"Authorization": f"Bearer {token}"}
    status, kind, text = scraped(address, bearer)
    families = {f.name: f for f in text_string_to_metric_families(text)}
    names = {sample.name for family in families.values() for sample in family.samples}
    # A metric without a value now has a family and no sample.
    names |= {f.name + ("_total" if f.type == "counter" else "") for f in families.values()}
    expressions = re.findall(r'"(?:expr|query|definition)": "((?:[^"\\]|\\.)*)"', Path(dashboard).read_text())
    used = {name for expression in expressions for name in re.findall(r"\bmuprime_\w+", expression)}
    print(json.dumps({
        "status": status,
        "type": kind,
        "families": {n: {"type": f.type, "unit": f.unit, "help": f.documentation} for n, f in families.items()},
        "samples": [[s.name, s.labels, s.value] for f in families.values() for s in f.samples],
        "query": scraped(address, {}, f"?token={token}")[0],
        "no_token": scraped(address, {})[0],
        "wrong_token": scraped(address, {"Authorization": "Bearer " + "0" * 64})[0],
        "wrong_origin": scraped(address, bearer | {"Origin": "https://evil.example"})[0],
        "wrong_host": scraped(address, bearer | {"Host": "evil.example"})[0],
        "used": sorted(used),
        "missing": sorted(used - names),
    }))


{"equal": equal, "metrics": metrics}[sys.argv[1]](*sys.argv[2:])
