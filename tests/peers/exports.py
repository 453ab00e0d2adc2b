"""Reads a run's folder and its exports with libraries that know nothing of muprime; prints what was found as JSON.

exports.py own RUN                every message of the records held against its own schema
exports.py signals RUN LAYOUTS    signals.mcap: schemas, units, layouts, and the curves held against the record
exports.py tables RUN             units and facts in Parquet (polars, pyarrow), Arrow (pyarrow), HDF5 (h5py, NeXus's way)
exports.py crate RUN              the RO-Crate: a validator's verdict, and the files' checksums
"""

import hashlib
import json
import pathlib
import sys
import xml.etree.ElementTree

RUN = pathlib.Path(sys.argv[2])


def messages(path):
    from mcap.reader import make_reader

    with open(path, "rb") as file:
        yield from make_reader(file, validate_crcs=True).iter_messages()


def validators():
    import jsonschema

    known = {}

    def check(schema, data):
        if schema.id not in known:
            assert schema.encoding == "jsonschema", schema.encoding
            text = json.loads(schema.data)
            jsonschema.Draft202012Validator.check_schema(text)
            known[schema.id] = jsonschema.Draft202012Validator(text)
        known[schema.id].validate(data)

    return check, known


def own():
    check, known = validators()
    counted = {}
    for path in sorted(RUN.glob("run-*.mcap")):
        for schema, channel, message in messages(path):
            check(schema, json.loads(message.data))
            counted[channel.topic] = counted.get(channel.topic, 0) + 1
    described = [v.schema.get("title") for v in known.values()]
    return {"messages": counted, "schemas": described}


def ok(result, *keys):
    for key in ("Ok", *keys):
        if not isinstance(result, dict) or key not in result:
            return None
        result = result[key]
    return result


# What a topic shows, said once more from the record's own JSON.
CURVES = {
    "/force/lateral_force_n": lambda r: ok(r["inputs"]["seen"]["forces"]["lateral"], "value"),
    "/force/normal_force_n": lambda r: ok(r["inputs"]["seen"]["forces"]["normal"], "value"),
    "/friction/mu_relative": lambda r: ok(r["mu_relative"], "value"),
    "/friction/mu_relative_wanted": lambda r: r.get("rendered") and r["rendered"]["wanted"],
    "/friction/residual_z": lambda r: r["online"] and r["online"]["z"],
    "/drive/amplitude_pp_m": lambda r: ok(ok(r["inputs"]["seen"]["amplifier"], "amplitude"), "value"),
    "/drive/commanded_amplitude_pp_m": lambda r: r["drive_pp_m"],
    "/stage/velocity_m_s": lambda r: ok(r["inputs"]["seen"]["stage"], "velocity_m_s"),
    "/loop/lateness_s": lambda r: r["inputs"]["seen"]["lateness"] * 1e-9,
    "/safety/armed": lambda r: float(r["armed"]),
    "/sweep/point": lambda r: None if r["marker"]["phase"] in ("idle", "zero") else float(r["marker"]["point"]),
}
UNITS = {"n": "N", "m": "m", "s": "s", "hz": "Hz", "c": "degC", "pa": "Pa", "pct": "%", "deg": "deg"}


def unit_of(name):
    if name.endswith("_m_s"):
        return "m/s"
    return UNITS.get(name.rsplit("_", 1)[-1], "1") if "_" in name else "1"


def at(points, times):
    """The value that held at each of the times, of points that are told at changes."""
    import bisect

    stamps = [t for t, _ in points]
    return [points[bisect.bisect_right(stamps, t) - 1][1] for t in times]


def signals():
    from mcap.reader import make_reader

    check, known = validators()
    curves, events = {}, []
    for schema, channel, message in messages(RUN / "signals.mcap"):
        data = json.loads(message.data)
        check(schema, data)
        if channel.topic == "/event":
            events.append((message.log_time, data))
        else:
            curves.setdefault(channel.topic, []).append((message.log_time, data["value"]))
    units = {v.schema["title"]: v.schema["properties"].get("value", {}).get("unit") for v in known.values()}
    for topic in curves:
        assert units[topic] == unit_of(topic), (topic, units[topic])
    rows, told = [], []
    for path in sorted(RUN.glob("run-*.mcap")):
        for _, channel, message in messages(path):
            data = json.loads(message.data)
            if channel.topic == "/cycle":
                rows.append((message.log_time, data))
            elif channel.topic == "/event":
                told.append((message.log_time, data))
    assert events == told
    compared = 0
    for topic, value in CURVES.items():
        want = [(t, value(row)) for t, row in rows]
        want = [(t, v) for t, v in want if v is not None]
        got = curves.get(topic, [])
        if len(got) < len(want):  # told at changes only
            got = [(t, v) for (t, _), v in zip(want, at(got, [t for t, _ in want]))]
        assert [t for t, _ in got] == [t for t, _ in want], topic
        assert all(abs(a - b) <= 1e-15 * abs(b) for (_, a), (_, b) in zip(got, want)), topic
        compared += len(want)
    with open(RUN / "signals.mcap", "rb") as file:
        reader = make_reader(file)
        channels = {c.topic for c in reader.get_summary().channels.values()}
        facts = {m.name: m.metadata for m in reader.iter_metadata()}
        attached = sorted(a.name for a in reader.iter_attachments())
    layouts = pathlib.Path(sys.argv[3])
    shown = json.loads((layouts / "foxglove.json").read_text())
    paths = []
    for name, panel in shown["configById"].items():
        paths += [p["value"] for p in panel.get("paths", [])]
        paths += [panel["xAxisPath"]["value"]] if "xAxisPath" in panel else []
        paths += [panel["topicPath"]] if "topicPath" in panel else []
    fox = [p.removesuffix(".value") for p in paths]

    def leaves(node):
        return [node] if isinstance(node, str) else leaves(node["first"]) + leaves(node["second"])

    assert sorted(leaves(shown["layout"])) == sorted(shown["configById"])
    tree = xml.etree.ElementTree.parse(layouts / "plotjuggler.xml")
    juggled = [c.attrib["name"] for c in tree.iter("curve")]
    assert all(name.endswith("/value") for name in juggled)
    missing = [t for t in fox + [n.removesuffix("/value") for n in juggled] if t not in channels]
    return {
        "topics": sorted(curves), "units": units, "compared": compared, "events": len(events),
        "facts": facts["muprime.run"], "attached": attached, "in_layouts": len(fox) + len(juggled),
        "missing": missing, "messages": sum(map(len, curves.values())), "cycles": len(rows),
    }


def tables():
    import csv

    import h5py
    import polars
    import pyarrow.ipc
    import pyarrow.parquet

    rows = list(csv.DictReader(open(RUN / "passes.csv")))
    forces = [float(row["lateral_force_n"]) for row in rows]
    told = polars.read_parquet_metadata(RUN / "passes.parquet")
    columns = {c["name"]: c for c in json.loads(told["muprime.columns"])}
    frame = polars.read_parquet(RUN / "passes.parquet")
    assert frame["lateral_force_n"].to_list() == forces and frame.columns == list(columns)
    parquet = pyarrow.parquet.read_schema(RUN / "passes.parquet")
    arrow = pyarrow.ipc.open_file(RUN / "passes.arrow").read_all()
    assert arrow["lateral_force_n"].to_pylist() == forces
    for schema in (parquet, arrow.schema):
        for field in schema:
            unit = field.metadata.get(b"unit")
            assert (unit and unit.decode()) == columns[field.name]["unit"], field
            assert field.metadata[b"description"].decode() == columns[field.name]["description"]
    with h5py.File(RUN / "passes.h5") as file:
        # The way to the default plot, as the NeXus manual has it.
        entry = file[file.attrs["default"]]
        data = entry[entry.attrs["default"]]
        classes = [file.attrs["NX_class"], entry.attrs["NX_class"], data.attrs["NX_class"]]
        signal, axis = data[data.attrs["signal"]], data[data.attrs["axes"]]
        assert signal.shape == axis.shape == (len(rows),)
        assert list(data["lateral_force_n"][:]) == forces
        hdf5 = {name: data[name].attrs.get("units") for name in data}
        assert all(u is None or (u or "1") == columns[n]["unit"] for n, u in hdf5.items()), hdf5
        facts = {name: entry["facts"][name][()].decode() for name in entry["facts"]}
        plotted = (data.attrs["signal"], data.attrs["axes"])
        person = entry["user/name"][()].decode()
    return {
        "rows": len(rows), "units": {n: c["unit"] for n, c in columns.items()}, "classes": classes,
        "plotted": plotted, "facts": {k: v for k, v in told.items() if k.startswith("muprime.")},
        "hdf5_facts": facts, "person": person,
        "arrow_facts": {k.decode(): v.decode() for k, v in arrow.schema.metadata.items()},
    }


def crate():
    import io

    import requests
    import rocrate
    import rocrate.rocrate
    import urllib3
    from rocrate_validator import services
    from rocrate_validator.models import Severity, ValidationSettings
    from rocrate_validator.utils import document_loader

    # The validator would fetch the vocabulary: it stands in the package of another implementation.
    vocabulary = (pathlib.Path(rocrate.__file__).parent / "data" / "ro-crate.jsonld").read_text()
    context = json.loads(vocabulary)
    asked = []

    def send(_adapter, request, **_):
        asked.append(request.url)
        found = request.url == context["@id"]
        answer = requests.Response()
        answer.status_code, answer.url, answer.request = 200 if found else 404, request.url, request
        answer.headers["Content-Type"] = "application/ld+json"
        answer.raw = urllib3.HTTPResponse(body=io.BytesIO(vocabulary.encode()), status=200, preload_content=False)
        return answer

    requests.adapters.HTTPAdapter.send = send
    document_loader._fetch_json_ld = lambda address: requests.get(address).json()
    settings = ValidationSettings(
        rocrate_uri=str(RUN), profile_identifier="ro-crate-1.3", requirement_severity=Severity.RECOMMENDED
    )
    issues = [f"{i.severity.name}: {i.message}" for i in services.validate(settings).get_issues(Severity.RECOMMENDED)]
    read = rocrate.rocrate.ROCrate(RUN)
    files = {e.id: e for e in read.data_entities}
    for name, entity in files.items():
        held = (RUN / name).read_bytes()
        assert entity["sha256"] == hashlib.sha256(held).hexdigest() and entity["contentSize"] == str(len(held))
    return {
        "issues": issues, "asked": asked, "files": sorted(files), "licence": read.root_dataset["license"].id,
        "author": read.root_dataset["author"]["name"], "orcid": read.root_dataset["author"].id,
    }


print(json.dumps({"own": own, "signals": signals, "tables": tables, "crate": crate}[sys.argv[1]]()))
