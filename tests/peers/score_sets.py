#!/usr/bin/env python3
"""Scores `muprime diagnose` on sets of third_generator.py and its followers up to sixth_generator.py.

usage: score_sets.py SETS [--program muprime] [--threads 2] [--until HH:MM]

Each set is diagnosed once; verdict.json beside it keeps the answer, so a second call continues after the first.
It prints shares with Wilson's 95 % intervals, and times in processor seconds.
"""
import argparse
import csv
import json
import os
import pathlib
import resource
import subprocess
import time

import numpy as np

SURE = 0.99


def diagnosed(folder, program, threads):
    """The verdict on one set, with the processor seconds that it took."""
    kept = folder / "verdict.json"
    if not kept.exists():
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        out = subprocess.run(
            [program, "diagnose", "train.csv", "--json", "--predict", "conditions.csv", "--predictions",
             "predictions.csv"],
            cwd=folder, capture_output=True, text=True, env={**os.environ, "RAYON_NUM_THREADS": str(threads)})
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        verdict = json.loads(out.stdout)
        if "verdict" not in verdict:
            raise SystemExit(f"{folder.name}: {out.stdout}{out.stderr}")
        verdict["seconds"] = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        kept.write_text(json.dumps(verdict))
    return json.loads(kept.read_text())


def judged(folder, verdict):
    """What the figures need of one set."""
    truth = json.loads((folder / "truth.json").read_text())
    s = {**{k: truth[k] for k in ("stratum", "cause", "form", "noise", "design", "detectable", "alone", "passes")},
         "set": folder.name, "verdict": verdict["verdict"], "seconds": verdict["seconds"]}
    first = verdict["hypotheses"][0]
    s["top"], s["class"] = sorted(first["effects"]), first["alias_class"]
    s["right_name"] = {"single": truth["cause"], "pair": truth["cause"], "none": [],
                       "stranger": ["unknown"]}[s["stratum"]]
    s["stated"] = [(sorted(h["effects"]), h["probability"]) for h in verdict["hypotheses"]]
    s["truth_p"] = next((p for e, p in s["stated"] if e == s["right_name"]), 0.0)
    named = s["verdict"] == "named"
    s["right"] = named and s["top"] == truth["cause"]
    s["member"] = named and set(s["top"]) < set(truth["cause"])
    s["wrong"] = named and not s["right"] and not s["member"]
    s["in_class"] = s["right"] or (s["verdict"] == "ambiguous" and "+".join(truth["cause"]) in
                                   ["+".join(sorted(c.split("+"))) if isinstance(c, str) else "+".join(sorted(c))
                                    for c in s["class"]])
    predicted = {int(r["point"]): float(r["lateral_force_corrected_n"])
                 for r in csv.DictReader(open(folder / "predictions.csv"))}
    hidden = [h for h in truth["hidden"] if h["point"] in predicted]
    error = np.array([(h["lateral_force_n"] - predicted[h["point"]]) / h["mu0_f_n"] for h in hidden])
    before = np.array([h["recalibrated_error"] for h in hidden])
    region = np.array([h["in_hidden_region"] for h in hidden])
    closed = lambda keep: 1 - np.sqrt((error[keep] ** 2).mean() / (before[keep] ** 2).mean()) if keep.any() else np.nan
    s["closed"], s["closed_region"] = closed(region | True), closed(region)
    s["interval"] = verdict["gap"]["shrinkage_ci95"]
    place = verdict["where"]["place"]
    s["place"] = max(place, key=place.get)
    s["description"] = [(x["structure"], x["covariate"]) for x in verdict["description"]]
    s["structure"] = truth["stranger"] and (truth["stranger"]["structure"], truth["stranger"]["covariate"])
    s["at_least"] = verdict.get("at_least", [])
    return s


PLACES = {
    "stiffness_error": "finger",
    **dict.fromkeys(("amplitude_miscalibration", "amplitude_droop", "amplitude_saturation", "resonance_detuning", "mode_shape"),
                    "plate"),
    **dict.fromkeys(("force_crosstalk", "lateral_offset_drift", "normal_offset", "plate_tilt", "speed_error", "speed_ripple"),
                    "instrument")}


def share(sets, test):
    """Count, share and Wilson's interval."""
    n, k = len(sets), sum(bool(test(s)) for s in sets)
    if not n:
        return "none of 0"
    p, z = k / n, 1.96
    middle, half = (p + z * z / 2 / n) / (1 + z * z / n), z / (1 + z * z / n) * np.sqrt(p * (1 - p) / n + z * z / 4
                                                            / n / n)
    return f"{k} of {n} ({p:.2f} [{max(middle - half, 0):.2f}, {min(middle + half, 1):.2f}])"


def figures(sets):
    """Prints the figures."""
    say = lambda what, value: print(f"{what:58} {value}")
    of = lambda stratum: [s for s in sets if s["stratum"] == stratum]
    singles, pairs, none, strangers = (of(x) for x in ("single", "pair", "none", "stranger"))
    seen = [s for s in singles if s["detectable"]]
    say("detectable singles: named right", share(seen, lambda s: s["right"]))
    say("detectable singles: in the stated class", share(seen, lambda s: s["in_class"]))
    say("detectable singles: named wrong", share(seen, lambda s: s["wrong"]))
    say("all singles: named wrong", share(singles, lambda s: s["wrong"]))
    say("none: named or a gap claimed", share(none, lambda s: s["verdict"] != "no_gap"))
    say("none: named", share(none, lambda s: s["verdict"] == "named"))
    shown = [s for s in strangers if s["detectable"]]
    say("strangers: named", share(strangers, lambda s: s["verdict"] == "named"))
    say("detectable strangers: unknown", share(shown, lambda s: s["verdict"] == "unknown"))
    unknown = [s for s in shown if s["verdict"] == "unknown"]
    say("detectable strangers: unknown, and first described right", share(shown, lambda s: s["description"][:1] == [s["structure"]]))
    say("  of those unknown: first described right", share(unknown, lambda s: s["description"][:1] == [s["structure"]]))
    say("  of those unknown: right among all described", share(unknown, lambda s: s["structure"] in s["description"]))
    clear = [s for s in pairs if s["detectable"] and min(s["alone"]) >= 30]
    say("pairs (each member alone has a chi2 of 30): both named", share(clear, lambda s: s["right"]))
    say("  named wrong", share(clear, lambda s: s["wrong"]))
    say("  one member alone named", share(clear, lambda s: s["member"]))
    say("  at_least right; wrong",
        f"{sum(bool(s['at_least']) and set(s['at_least']) <= set(s['cause']) for s in clear)}; "
        f"{sum(bool(set(s['at_least']) - set(s['cause'])) for s in clear)}")
    told = none + [s for s in seen + shown + clear]
    sure = [(e, e == s["right_name"], s) for s in told for e, p in s["stated"] if p >= SURE]
    say("stated 0.99 and more is right", share(sure, lambda x: x[1]))
    say("  of those that state a cause", share([x for x in sure if x[0] and x[0] != ["unknown"]], lambda x: x[1]))
    for words in ("single", "pair", "stranger"):
        say(f"  of a {words}", share([x for x in sure if x[2]["stratum"] == words], lambda x: x[1]))
    for words, part in (("singles", seen), ("pairs", clear), ("strangers", shown), ("none", none), ("all", told)):
        if part:
            scores = [np.log(max(s["truth_p"], 1e-9)) for s in part]
            say(f"log score of the truth, nats (not below -20.7): {words}", f"{np.mean(scores):.2f} of {len(part)}")
    for words, key in (("hidden passes", "closed"), ("hidden regions", "closed_region")):
        for name, part in (("detectable singles", seen), ("named right", [s for s in singles if s["right"]]),
                           ("pairs", clear)):
            values = [s[key] for s in part if np.isfinite(s[key])]
            if values:
                say(f"gap closed on {words}, {name}: median, worst tenth",
                    f"{np.median(values):.2f}, {np.quantile(values, 0.1):.2f} of {len(values)}")
    stated = [s for s in singles + pairs if s["detectable"] and s["interval"] and s["interval"][0] is not None]
    covers = lambda s, key: s["interval"][0] <= s[key] <= s["interval"][1]
    say("shrinkage_ci95 covers what was closed: all detectable", share(stated, lambda s: covers(s, "closed")))
    say("  of those named right", share([s for s in stated if s["right"]], lambda s: covers(s, "closed")))
    named = [s for s in singles if s["verdict"] == "named"]
    say("place right, of named singles", share(named, lambda s: s["place"] == PLACES.get(s["cause"][0], "contact")))
    seconds = [s["seconds"] for s in sets]
    say("processor seconds: median, 95 %, worst", "%.1f, %.1f, %.1f" % (*np.quantile(seconds, (0.5, 0.95)),
                                                            max(seconds)))
    for key in ("noise", "design"):
        for value in sorted({s[key] for s in sets}):
            part = [s for s in seen if s[key] == value]
            every, still = [s for s in sets if s[key] == value], [s for s in none if s[key] == value]
            say(f"{key} {value}: named right; wrong; gap claimed of none",
                f"{share(part, lambda s: s['right'])}; {sum(s['wrong'] for s in every)} of {len(every)}; "
                f"{sum(s['verdict'] != 'no_gap' for s in still)} of {len(still)}")
    print("cause: detectable, right, in class, unknown, wrong; seconds")
    for name in sorted({s["cause"][0] for s in singles}):
        part = [s for s in seen if s["cause"] == [name]]
        counts = [len(part)] + [sum(bool(s[k]) for s in part) for k in ("right",
                                                            "in_class")] + [sum(s["verdict"] == "unknown"
                                                            for s in part), sum(s["wrong"] for s in part)]
        print(f"  {name:28}", counts, round(np.median([s["seconds"] for s in part]), 1) if part else "")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sets", type=pathlib.Path)
    parser.add_argument("--program", default="muprime")
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--until", help="time of day after which no further set is begun")
    parser.add_argument("--lines", action="store_true", help="one line a set")
    a = parser.parse_args()
    folders = sorted(f for f in a.sets.iterdir() if (f / "truth.json").exists())
    order = np.random.default_rng(3).permutation(1 + max(int(f.name[4:]) for f in folders))
    place = {int(n): i for i, n in enumerate(order)}
    sets = []
    for folder in sorted(folders, key=lambda f: place[int(f.name[4:])]):
        if (folder / "verdict.json").exists() or not a.until or time.strftime("%H:%M") < a.until:
            sets.append(judged(folder, diagnosed(folder, a.program, a.threads)))
            if a.lines:
                s = sets[-1]
                print(s["set"], s["stratum"], *s["cause"], s["form"], s["noise"], s["detectable"], "->",
                      s["verdict"], s["top"], round(s["stated"][0][1], 3), s["description"][:2], f"{s['seconds']:.1f} s", flush=True)
    print(f"{len(sets)} of {len(folders)} sets are scored")
    figures(sets)


if __name__ == "__main__":
    main()
