//! Pages as files and over HTTP: what a reader clicks is there, published values are on the axes, and a
//! window of a record comes as it was recorded.

use runs::report::traces::{TraceWindow, within};
use serde_json::Value;
use std::collections::BTreeSet;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, Stdio};
use tests::{muprime, short_plan, texts};

/// A short run in virtual time.
fn run(folder: &Path, setup: &str) -> std::path::PathBuf {
    let (plan, out) = (short_plan(folder), folder.join("runs/short"));
    let made =
        muprime().args(["run", &plan, "--fast", "--setup", setup, "--out"]).arg(&out).output().unwrap();
    assert!(made.status.code().is_some_and(|code| code < 2), "{}", texts(&made).1);
    out
}

/// Without a pass that is not vibrated mu_0 is the model's: 'measured' mu' rested on the model and nothing
/// said so. Two such runs cannot be compared; which of two it is was not said either.
#[test]
fn a_run_without_references_says_that_its_mu_rests_on_the_model() {
    let folder = tempfile::tempdir().unwrap();
    let with = run(folder.path(), "virtual-ideal");
    let plan = folder.path().join("bare.toml");
    let text = std::fs::read_to_string(short_plan(folder.path())).unwrap();
    let vibrated = text.lines().filter(|line| !line.starts_with("reference_every"));
    let bare =
        vibrated.collect::<Vec<_>>().join("\n").replace("amplitude_pp_m = [0.0, ", "amplitude_pp_m = [");
    std::fs::write(&plan, format!("reference_every = 0\n{bare}\n")).unwrap();
    let out = folder.path().join("bare");
    let ran = |out: &Path| {
        let run = ["run", plan.to_str().unwrap(), "--fast", "--setup", "virtual-ideal", "--out"];
        muprime().args(run).arg(out).output().unwrap()
    };
    let remark = "no pass without vibration: mu_0 is that of the model";
    let said = texts(&ran(&out));
    assert!(said.1.split_whitespace().collect::<Vec<_>>().join(" ").contains(remark), "{}", said.1);
    for (run, remarked) in [(&out, true), (&with, false)] {
        for file in ["summary.json", "report.html"] {
            let text = std::fs::read_to_string(run.join(file)).unwrap();
            assert_eq!(text.contains(remark), remarked, "{}", run.join(file).display());
        }
    }
    // The load that the loop commanded is beside the one that was measured.
    let passes = std::fs::read_to_string(out.join("passes.jsonl")).unwrap();
    let has_load = |line: &str| line.contains("\"commanded_normal_force_n\":0.25");
    assert!(passes.lines().all(has_load), "{passes}");
    let compared = muprime().arg("compare").args([&with, &out]).output().unwrap();
    let why = texts(&compared).1;
    assert!(why.contains("bare: the run has no pass") && !why.contains("short"), "{why}");
}

/// What stands between two texts, each time.
fn between<'a>(text: &'a str, from: &str, to: &str) -> Vec<&'a str> {
    text.split(from).skip(1).filter_map(|rest| rest.split_once(to).map(|(found, _)| found)).collect()
}

fn page_of(arguments: &[&str], page: &Path) -> String {
    let output = muprime().args(arguments).output().unwrap();
    assert!(output.status.success(), "{arguments:?}: {}", texts(&output).1);
    std::fs::read_to_string(page).unwrap()
}

/// Both maps have one scale, and every pass as a mark that leads to its numbers; a cause has its drawing and
/// its law; the plan is a link.
#[test]
fn the_page_of_a_verdict_leads_to_every_pass_and_to_the_next_plan() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("first");
    let made = muprime().args(["run", "--fast", "--out"]).arg(&out).output().unwrap();
    assert!(made.status.code().is_some_and(|code| code < 2), "{}", texts(&made).1);
    let page = folder.path().join("verdict.html");
    let html = page_of(&["diagnose", out.to_str().unwrap(), "--report", page.to_str().unwrap()], &page);
    let rows: BTreeSet<&str> = between(&html, "<tr id=\"pass-", "\"").into_iter().collect();
    let points = std::fs::read_to_string(out.join("points.csv")).unwrap();
    assert_eq!(rows.len(), points.lines().count() - 1, "a row a pass");
    let maps = between(&html, "<table class=\"map\">", "</table>");
    assert!(maps.len() >= 2 && maps.len().is_multiple_of(2), "{} maps", maps.len());
    for (i, map) in maps.iter().enumerate() {
        assert!(map.contains(["Gap before", "Gap after"][i % 2]), "{map}");
        let marks = between(map, "href=\"#pass-", "\"");
        assert_eq!(marks.len(), rows.len(), "a mark a pass");
        assert_eq!(marks.into_iter().collect::<BTreeSet<_>>(), rows);
    }
    // One scale: its deepest shade is that of the greatest mean of all maps, and no cell's shade is another's
    // for the same number.
    assert_eq!(html.matches("<p class=\"scale\">").count(), 1);
    let end: f64 = between(&html, "</span>+", " ")[0].parse().unwrap();
    let mut greatest = 0.0_f64;
    for cell in maps.iter().flat_map(|map| between(map, "<td class=\"", "<div>")) {
        let (shade, mean) = cell.split_once("\">").unwrap();
        let mean: f64 = mean.parse().unwrap();
        let step = shade.trim_start_matches('k').replace('m', "-").parse::<f64>().unwrap();
        assert!((8.0 * mean / end - step).abs() <= 0.6 + 0.008 / end, "{mean} of {end} is {shade}");
        greatest = greatest.max(mean.abs());
    }
    assert!((greatest / end - 1.0).abs() < 0.02, "{greatest} and {end}");
    // The gap that the cause takes away: squeeze film, which acts through the air.
    assert!(
        html.contains("Where it acts: air.") && html.contains("The law of squeeze film against "),
        "no law"
    );
    // The plan within its link is a file, with the names that files have.
    let words: String = html
        .split("href=\"data:application/toml")
        .map(|part| part.split_once('"').map_or(part, |p| p.1))
        .collect();
    assert!(
        !words.contains("squeeze_film") && !words.contains(" um"),
        "an identifier, or um for micrometres"
    );
    for plan in between(&html, "href=\"data:application/toml;charset=utf-8,", "\"") {
        let file = folder.path().join("next-plan.toml");
        std::fs::write(&file, decoded(plan)).unwrap();
        let checked = muprime().arg("check").arg(&file).output().unwrap();
        assert!(checked.status.success(), "{}\n{}", texts(&checked).0, texts(&checked).1);
        let text = std::fs::read_to_string(&file).unwrap();
        assert_eq!(text.matches("[[series]]").count(), 12, "{text}");
    }
    let links = html.matches("download=\"next-plan.toml\"").count();
    assert_eq!(links, html.matches("Measure these 12 passes").count());
    assert!(links > 0, "the verdict has no next measurement: this test tries nothing");
}

/// An address's part without its escapes.
fn decoded(text: &str) -> Vec<u8> {
    let mut bytes = text.bytes();
    let mut all = Vec::new();
    while let Some(byte) = bytes.next() {
        all.push(match byte {
            b'%' => {
                let two = [bytes.next().unwrap(), bytes.next().unwrap()];
                u8::from_str_radix(std::str::from_utf8(&two).unwrap(), 16).unwrap()
            }
            plain => plain,
        });
    }
    all
}

#[test]
fn published_values_are_on_the_axes_with_their_source() {
    let folder = tempfile::tempdir().unwrap();
    let out = run(folder.path(), "virtual-ideal");
    let (run, page) = (out.to_str().unwrap(), out.join("report.html"));
    let plain = page_of(&["report", run], &page);
    assert!(!plain.contains("Published values"));
    let own = folder.path().join("own.csv");
    let rows = "source,what,mu_relative,mu_relative_sd,amplitude_pp_m,frequency_hz,speed_m_s\n\
                \"Smith <2020>\",first,0.41,0.02,2e-6,27500,0.01\n\"Smith <2020>\",second,0.9,,,35000,\n";
    std::fs::write(&own, rows).unwrap();
    let html = page_of(&["report", run, "--overlay", "paper", "--overlay", own.to_str().unwrap()], &page);
    let section = between(&html, "<h2>Published values</h2>", "<h2>")[0];
    assert_eq!(between(section, "<figure>", "</figure>").len(), 3, "against w, f and U");
    for (words, times) in [
        ("Eq. 20 with \u{3a8}* 2.38 \u{b1} 0.21 (the paper, section 5.2, Eq. 20)", 3),
        ("<th scope=\"row\">the paper, section 5.1</th>", 3),
        ("0.4 to 0.8", 1),
        ("Smith &lt;2020&gt;</th>", 2),
        ("0.41 &plusmn; 0.02", 1),
        ("Hollow where the source states other conditions", 3),
    ] {
        assert_eq!(section.matches(words).count(), times, "{words}:\n{section}");
    }
    // The first value has an amplitude, a frequency and a speed; the second a frequency alone.
    assert_eq!(section.matches("Squares: Smith").count() + section.matches("Triangles: Smith").count(), 3);
    std::fs::write(&own, rows.replace("0.02,2e-6", "-0.02,2e-6")).unwrap();
    let refused = muprime().args(["report", run, "--overlay"]).arg(&own).output().unwrap();
    let why = texts(&refused).1;
    assert!(!refused.status.success() && why.contains("line 2: mu_relative_sd = -0.02"), "{why}");
    assert_eq!(std::fs::read_to_string(&page).unwrap(), html, "a refusal writes nothing");
}

/// A `muprime dashboard` of a folder of runs.
struct Served {
    process: Child,
    token: String,
    place: String,
}

impl Served {
    fn start(runs: &Path) -> Self {
        let mut command = muprime();
        command.args(["--json", "dashboard", "--listen", "127.0.0.1:0", "--folder"]).arg(runs);
        let mut process = command.stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap();
        let mut line = String::new();
        BufReader::new(process.stdout.take().unwrap()).read_line(&mut line).unwrap();
        let stated: Value = serde_json::from_str(&line).unwrap();
        let text = |key: &str| stated[key].as_str().unwrap().to_string();
        let token = text("dashboard").rsplit_once('=').unwrap().1.to_string();
        Served { process, token, place: text("address") }
    }

    /// Status and body of a request.
    fn get(&self, address: &str, token: &str, more: &str) -> (u16, String) {
        let mut stream = TcpStream::connect(&self.place).unwrap();
        let host = if more.contains("Host: ") { String::new() } else { format!("Host: {}\r\n", self.place) };
        write!(
            stream,
            "GET {address} HTTP/1.1\r\n{host}Authorization: Bearer {token}\r\nConnection: close\r\n{more}\r\n"
        )
        .unwrap();
        let mut bytes = Vec::new();
        stream.read_to_end(&mut bytes).unwrap();
        let text = String::from_utf8(bytes).unwrap();
        let (head, body) = text.split_once("\r\n\r\n").unwrap();
        (head.split(' ').nth(1).unwrap().parse().unwrap(), body.to_string())
    }
}

impl Drop for Served {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

/// Numbers of a trace, as explore.js reads them.
fn unpacked(text: &Value) -> Vec<Option<i64>> {
    const DIGITS: &str = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let (mut all, mut before, mut left, mut shift) = (Vec::new(), 0, 0_i64, 0);
    for digit in text.as_str().unwrap().chars() {
        let digit = DIGITS.find(digit).unwrap() as i64;
        left += (digit % 32) << shift;
        shift += 5;
        if digit < 32 {
            all.push((left > 0).then(|| {
                before += if left % 2 == 1 { (left - 1) / 2 } else { -left / 2 };
                before
            }));
            (left, shift) = (0, 0);
        }
    }
    all
}

/// All values of one quantity over the traces of a window.
fn column(window: &Value, of: impl Fn(&Value) -> &Value) -> Vec<Option<i64>> {
    window["traces"].as_array().unwrap().iter().flat_map(|trace| unpacked(of(trace))).collect()
}

#[test]
fn a_window_of_the_record_comes_as_it_was_recorded_and_to_nobody_else() {
    let folder = tempfile::tempdir().unwrap();
    let out = run(folder.path(), "virtual-ideal");
    let served = Served::start(&folder.path().join("runs"));
    let token = served.token.clone();
    let address = |from: f64, to: f64| format!("/api/runs/short/cycles?from_s={from}&to_s={to}");
    let fetch = |from: f64, to: f64| {
        let (status, body) = served.get(&address(from, to), &token, "");
        assert_eq!(status, 200, "{body}");
        serde_json::from_str::<Value>(&body).unwrap()
    };
    // Every cycle of a second, at 1 kHz, as the record has it: read here by another reader of the format.
    let rows = recorded(&out.join("run-1.mcap"));
    let (from, to) = (rows[0].0 as f64 * 1e-9 + 0.3, rows[0].0 as f64 * 1e-9 + 1.3);
    let inside = |t: u64| (from..=to).contains(&(t as f64 * 1e-9));
    let wanted: Vec<(i64, Option<i64>)> =
        rows.iter().filter(|(t, _)| inside(*t)).map(|(t, f)| ((t / 100_000) as i64, *f)).collect();
    assert!(wanted.len() > 500, "{} cycles of passes in a second", wanted.len());
    let raw = fetch(from, to);
    assert_eq!(raw["stretch"], 1);
    let times: Vec<i64> = column(&raw, |t| &t["t"]).into_iter().flatten().collect();
    assert_eq!(times, wanted.iter().map(|w| w.0).collect::<Vec<_>>());
    for i in 0..2 {
        assert_eq!(column(&raw, |t| &t["lateral"][i]), wanted.iter().map(|w| w.1).collect::<Vec<_>>());
    }
    // The whole run is thinned: stretches, whose least and greatest are those of all their cycles.
    let whole = fetch(0.0, 1e6);
    let stretch = whole["stretch"].as_u64().unwrap() as usize;
    let [low, high] = [0, 1].map(|i| column(&whole, |t| &t["lateral"][i]));
    assert!(stretch > 1 && low.len() < 2100 && low.len() > 1000, "{stretch}: {}", low.len());
    let all: Vec<i64> = rows.iter().filter_map(|r| r.1).collect();
    assert_eq!(low.iter().flatten().min(), all.iter().min());
    assert_eq!(high.iter().flatten().max(), all.iter().max());
    assert!(low.iter().flatten().zip(high.iter().flatten()).all(|(low, high)| low <= high));
    // The page of the run has at most a hundred stretches a pass, of the same values.
    let page = std::fs::read_to_string(out.join("report.html")).unwrap();
    let data: Value = serde_json::from_str(between(&page, "id=\"run-data\">", "</script>")[0]).unwrap();
    for trace in data["traces"].as_array().unwrap() {
        assert!(unpacked(&trace["t"]).len() <= 100);
    }
    assert_eq!(column(&data, |t| &t["lateral"][1]).iter().flatten().max(), all.iter().max());
    assert_eq!(within(&out, [1e7, 2e7]).unwrap(), TraceWindow { stretch: 1, traces: Vec::new() });
    // The guard of every other address, and windows that are none.
    let good = address(from, to);
    for (address, token, more, status) in [
        (good.as_str(), "", "", 401),
        (&good, "0000", "", 401),
        (&good, &token, "Origin: http://elsewhere.example\r\n", 403),
        (&good, &token, "Host: elsewhere.example\r\n", 421),
        ("/api/runs/other/cycles?from_s=0&to_s=1", &token, "", 404),
        ("/api/runs/short/cycles?from_s=2&to_s=1", &token, "", 422),
        ("/api/runs/short/cycles?from_s=NaN&to_s=1", &token, "", 422),
        ("/api/runs/short/cycles?from_s=0&to_s=inf", &token, "", 422),
        ("/api/runs/short/cycles?from_s=0", &token, "", 400),
    ] {
        assert_eq!(served.get(address, token, more).0, status, "{address} {more}");
    }
}

/// Loop time in ns and lateral force in 0.1 mN of every cycle of a pass, by the MCAP library.
fn recorded(record: &Path) -> Vec<(u64, Option<i64>)> {
    let bytes = std::fs::read(record).unwrap();
    let mut all = Vec::new();
    for message in mcap::MessageStream::new(&bytes).unwrap() {
        let message = message.unwrap();
        if message.channel.topic != realtime::recorder::CYCLES {
            continue;
        }
        let row: Value = serde_json::from_slice(&message.data).unwrap();
        if ["idle", "zero"].contains(&row["marker"]["phase"].as_str().unwrap().to_lowercase().as_str()) {
            continue;
        }
        let force = row["inputs"]["seen"]["forces"]["lateral"]["Ok"]["value"].as_f64();
        all.push((row["now"].as_u64().unwrap(), force.map(|f| (f * 1e4).round() as i64)));
    }
    all
}

/// The panels pooled two pressures under a line at one of them that nothing named. Odds had two forms, and
/// the baseline two names.
#[test]
fn the_page_of_a_verdict_states_its_pressure_and_odds_as_the_terminal_does() {
    let folder = tempfile::tempdir().unwrap();
    let (plan, out) = (folder.path().join("air.toml"), folder.path().join("air"));
    let text = "name = \"air\"\nseed = 5\nreplicates = 2\nreference_every = 5\n[pass]\nsettle_s = 0.1\nmeasure_s = 0.2\n\
        [base]\namplitude_pp_m = 2e-6\nfrequency_hz = 27500\nspeed_m_s = 0.02\nnormal_force_n = 0.25\n[[series]]\n\
        amplitude_pp_m = [0.4e-6, 0.8e-6, 1.35e-6, 2e-6, 2.5e-6]\n[[series]]\n\
        amplitude_pp_m = [1.35e-6, 2.5e-6]\nambient_pressure_pa = [101325, 50000]\n";
    std::fs::write(&plan, text).unwrap();
    let made = muprime().args(["run", "--fast"]).arg(&plan).arg("--out").arg(&out).output().unwrap();
    assert!(made.status.code().is_some_and(|code| code < 2), "{}", texts(&made).1);
    let page = folder.path().join("verdict.html");
    let said = muprime().arg("diagnose").arg(&out).arg("--report").arg(&page).output().unwrap();
    let (said, html) = (texts(&said).0, std::fs::read_to_string(&page).unwrap());
    let points = std::fs::read_to_string(out.join("points.csv")).unwrap();
    let head: Vec<&str> = points.lines().next().unwrap().split(',').collect();
    let at = |name: &str| head.iter().position(|one| *one == name).unwrap();
    let (w, pa) = (at("amplitude_pp_m"), at("ambient_pressure_pa"));
    let rows: Vec<Vec<f64>> = points
        .lines()
        .skip(1)
        .map(|row| row.split(',').map(|v| v.parse().unwrap_or(f64::NAN)).collect())
        .collect();
    let driven = rows.iter().filter(|row| row[w] > 0.0);
    let (thin, all) = (driven.clone().filter(|row| row[pa] < 6e4).count(), driven.count());
    let shown = format!(
        "{} of {all} passes with vibration, those at the conditions that are most common; {thin} at other pressures are left out.",
        all - thin
    );
    assert!(thin > 0 && html.contains(&shown), "{shown}");
    assert!(html.contains(" N, 101 kPa.</figcaption>"), "no pressure at the panel");
    assert!(html.contains(">nominal baseline<") && !html.contains("baseline as calibrated"));
    let odds = between(&html, " is true, ", " against ");
    assert!(!odds.is_empty(), "the verdict has no next measurement: this test tries nothing");
    for odds in odds {
        assert!(said.contains(odds), "{odds}\n{said}");
    }
}
