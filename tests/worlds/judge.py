"""Runs a kincal on every case and counts: the place, the name, the path that nobody fitted."""
import concurrent.futures
import json
import os
import pathlib
import statistics
import subprocess

REVERSAL = ["backlash", "hysteresis", "direction_dependent_pose"]
CLEARANCE = ["gravity_compliance (compliance_with_clearance)", "gravity_compliance (stiffening_compliance)"]
RIGHT = {
    # Under weight play sits on one flank, and goes over where the weight changes sides.
    "play": REVERSAL + ["gravity_backlash"] + CLEARANCE,
    "play_held": REVERSAL + ["gravity_backlash"] + CLEARANCE,
    "friction": REVERSAL + ["stribeck_friction", "reversal_spike"],
    "lugre": REVERSAL + ["stribeck_friction", "reversal_spike"],
    "flex": ["gravity_compliance", "payload_compliance", "inertial_error"],
    "weight": ["gravity_compliance", "payload_compliance", "inertial_error"],
    "cogging": ["cyclic_error"],
    "delay": ["servo_lag"],
    "no_forward": ["servo_lag"],
    # What Exudyn moves. A ball that is too large moves the axis across once in a turn of the cage.
    "odd_ball": ["radial_runout"],
    "flexible_link": ["gravity_compliance", "payload_compliance"],
}
# Every loop gives way a little under acceleration and weight, and follows a little late.
LOOP = ["inertial_error", "servo_lag", "gravity_compliance"]
# What an answer that tells no more than a name stands for.
KINDS = {"backlash": "play", "hysteresis": "friction", "gravity_compliance": "flex", "cyclic_error": "cogging", "servo_lag": "delay"}
SURE, CARRIES, IDLE = 0.5, 0.25, 0.05


def wilson(k, n):
    """95 % bounds of a proportion."""
    if not n:
        return 0.0, 1.0
    z, p = 1.959964, k / n
    middle, half = (p + z * z / (2 * n)) / (1 + z * z / n), z / (1 + z * z / n) * (p * (1 - p) / n + z * z / (4 * n * n)) ** 0.5
    return max(middle - half, 0), min(middle + half, 1)


def names(finding):
    """What a finding is called, with and without its form."""
    form = finding.get("form")
    return [finding["effect"]] + ([f"{finding['effect']} ({form})", form] if form else [])


def others(finding):
    """What else a finding may be, and where else."""
    return finding["confusable_with"] + [{"effect": finding["effect"], "at": other["at"]} for other in finding.get("also_at", [])]


def answered(folder, out):
    """Answers, those of other simulators with what they leave out."""
    for a in json.loads((folder / "answers.json").read_text()):
        head = next((folder / a["case"]).glob("rec_*.csv")).read_text()[:400]
        yield {"file": f"{a['machine']}.ron", "measurement": head.split("# measurement: ")[1].split()[0], "found": out,
               "physics": [{"kind": KINDS.get(name, name), "at": at} for name, at in a["concealed"]], "textbook_um": {"plain": None, "best": None, "column": None}} | a


def run(program, folder, machines, answer, again, rivals):
    case, out = answer["case"], answer["found"]
    machine = str(pathlib.Path(machines) / answer["file"])
    recordings = sorted(str(p) for p in (folder / case).glob("rec_*.csv"))
    path, plain, found, told = (str(p) for p in (folder / "judge" / f"{case}.csv", out / f"{case}.plain.ron", out / f"{case}.found.ron", out / f"{case}.json"))
    call = lambda *a: subprocess.run([program, *a], capture_output=True, text=True, env=dict(os.environ, RAYON_NUM_THREADS="1"))
    if not again or not pathlib.Path(told).exists():
        for p in (plain, found, told):
            pathlib.Path(p).unlink(missing_ok=True)
        text = call("calibrate", machine, *recordings, "-o", plain, "--quiet").stderr
        diagnosed = call("diagnose", machine, *recordings, "-o", found, "--json", told)
        (out / f"{case}.txt").write_text(diagnosed.stdout + text + diagnosed.stderr)

    def error(model):
        done = call("predict", model, path, "--json", "-", "--quiet")
        return json.loads(done.stdout)["rms_m"] * 1e6 if done.returncode == 0 else None
    told = json.loads(pathlib.Path(told).read_text()) if pathlib.Path(told).exists() else None
    lines = {"kincal": score(answer, told, error(plain), error(found))}
    if rivals:
        from rivals import compete
        for name, (effects, before, after) in compete(folder, machines, answer).items():
            findings = [{"effect": e, "at": at, "probability": 1.0, "confusable_with": []} for e, at in effects]
            lines[name] = score(answer, {"findings": findings}, before, after)
    return lines


def score(answer, told, plain, diagnosed):
    """One case's line."""
    share = {n: s[0] for n, s in answer["share_and_rms_um"].items()}
    kinds = {p["at"]: p["kind"] for p in answer["physics"]}
    findings = told["findings"] if told else []
    parts = ((told or {}).get("unexplained") or {}).get("parts") or []
    first = findings[0] if findings else parts[0] if parts else (told or {}).get("unexplained")
    at = first["at"] if first else None
    right = RIGHT[kinds[at]] if at in kinds else LOOP if share.get(at, 0) >= CARRIES else []
    of_loop = lambda f: f["effect"] in LOOP and f.get("form") != "lateral_compliance" and f["at"] in share
    describes = lambda f: f["at"] in kinds and any(n in RIGHT[kinds[f["at"]]] for n in names(f))
    sure = [f for f in findings if f["probability"] > SURE]
    line = {
        "case": answer["case"], "machine": answer["machine"], "measurement": answer["measurement"], "physics": [[p["kind"], p["at"]] for p in answer["physics"]],
        "carried": {n: s for n, s in share.items() if abs(s) >= IDLE}, "read": told is not None,
        "found": [[*f"{names(f)[1] if len(names(f)) > 1 else f['effect']}@{f['at']}".split("@"), round(f["probability"], 2)] for f in findings],
        "parts": [[p["at"], p.get("depends_on"), p.get("modelled")] for p in parts],
        "place": bool(first) and share.get(at, 0) >= CARRIES,
        "named": bool(findings) and any(n in right for n in names(findings[0])),
        "among": bool(findings) and any(n in right for n in names(findings[0])) or any(
            c["at"] in kinds and c["effect"] in RIGHT[kinds[c["at"]]] for c in (others(findings[0]) if findings else [])),
        "silent": not findings,
        "wrong": [f"{f['effect']} {f['at']}" for f in sure if abs(share.get(f["at"], 0)) < IDLE and not of_loop(f)],
        "amiss": [f"{f['effect']} {f['at']}" for f in sure if abs(share.get(f["at"], 0)) >= IDLE and not of_loop(f) and not describes(f)],
        "beside": [f"{f['effect']} {f['at']}" for f in findings if not of_loop(f)],
        "plain_um": plain, "diagnosed_um": diagnosed, "textbook": answer["textbook_um"],
    }
    line["ratio"] = diagnosed / plain if plain and diagnosed is not None else None
    line["as_textbook"] = diagnosed is not None and answer["textbook_um"]["best"] is not None and diagnosed <= 1.1 * answer["textbook_um"]["best"]
    line["worse"] = line["ratio"] is not None and line["ratio"] > 1.05
    return line


def table(lines):
    """Counts with their bounds, by all and by kind of machine."""
    out = {}
    for title, group in [("all", lines), ("ballbar", [l for l in lines if l["measurement"] == "distance"]), ("arm", [l for l in lines if l["measurement"] != "distance"])]:
        hidden, clean = [l for l in group if l["physics"]], [l for l in group if not l["physics"]]
        of = lambda key, some: [sum(bool(l[key]) for l in some), len(some), *wilson(sum(bool(l[key]) for l in some), len(some))]
        ratios = [l["ratio"] for l in hidden if l["ratio"] is not None]
        against = [l["diagnosed_um"] / l["textbook"]["best"] for l in hidden if l["diagnosed_um"] is not None and l["textbook"]["best"]]
        out[title] = {
            "cases": len(group),
            "place": of("place", hidden), "name right first": of("named", hidden), "or among what it may be instead": of("among", hidden), "no name told": of("silent", hidden),
            "as good as the textbook column": of("as_textbook", [l for l in hidden if l["textbook"]["best"]]), "worse than plain": of("worse", group),
            "clean, another name than the loop's": of("beside", clean),
            "wrong names a case": sum(len(l["wrong"]) for l in group) / max(len(group), 1),
            "names amiss a case": sum(len(l["amiss"]) for l in group) / max(len(group), 1),
            "diagnosed / plain, median": statistics.median(ratios) if ratios else None,
            "diagnosed / textbook, median": statistics.median(against) if against else None,
        }
    return out


def show(line):
    number = lambda x: "-" if x is None else f"{x:.2f}"
    print(f"{line['case']} {line['machine']}: {', '.join(' '.join(p) for p in line['physics']) or 'clean'} "
          f"({', '.join(f'{n} {s:.2f}' for n, s in line['carried'].items())})\n"
          f"    place {'yes' if line['place'] else 'no '}  name {'yes' if line['named'] else 'no '}  path {number(line['plain_um'])} -> {number(line['diagnosed_um'])} um, "
          f"textbook {number(line['textbook']['best'])} ({line['textbook']['column']})"
          f"{'' if line['read'] else '  not read'}{'  wrong: ' + ', '.join(line['wrong']) if line['wrong'] else ''}{'  amiss: ' + ', '.join(line['amiss']) if line['amiss'] else ''}\n"
          f"    told: {'; '.join(f'{e} {a} {p}' for e, a, p in line['found']) or 'no name'}"
          f"{'; unnamed ' + '; '.join(a + ' by ' + ' and '.join(d or []) for a, d, _ in line['parts']) if line['parts'] else ''}", flush=True)


def judge(folder, program, machines, jobs, only, again, rivals, found, json_to):
    folder = pathlib.Path(folder)
    found = pathlib.Path(found or folder / "found")
    found.mkdir(parents=True, exist_ok=True)
    answers = [a for a in answered(folder, found) if not only or a["case"] in only]
    lines = {}
    with concurrent.futures.ThreadPoolExecutor(jobs) as pool:
        for made in pool.map(lambda a: run(program, folder, machines, a, again, rivals), answers):
            show(made["kincal"])
            for who, line in made.items():
                lines.setdefault(who, []).append(line)
    result = {who: table(those) for who, those in lines.items()}
    groups = [(who, title, rows) for who, titles in result.items() for title, rows in titles.items() if rows["cases"] and (who == "kincal" or title == "all")]
    for who, title, rows in groups:
        print(f"\n{who}, {rows['cases']} cases" + ("" if title == "all" else f" with {title}"))
        for name, value in rows.items():
            if isinstance(value, list):
                k, n, low, high = value
                print(f"    {name:38} {k:3} of {n:3}" + (f"   {k / n:4.0%} [{low:.0%}, {high:.0%}]" if n else ""))
            elif name != "cases":
                print(f"    {name:38} {'-' if value is None else f'{value:.2f}'}")
    if json_to:
        pathlib.Path(json_to).write_text(json.dumps({"tables": result, "cases": lines}, indent=1) + "\n")
