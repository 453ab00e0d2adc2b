//! Errors as people provoke them: each is provoked here, and docs/how-to/errors.md says what the program answers.

use std::path::Path;
use std::process::Output;
use tests::{muprime, texts};

/// Files that the provocations name.
const FILES: &[(&str, &str)] = &[
    ("misspelt.toml", "name = \"a\"\n[base]\namplitude = [1e-6]\n[[series]]\n"),
    (
        "negative.toml",
        "name = \"a\"\nreplicates = -1\n[base]\namplitude_pp_m = 2e-6\nfrequency_hz = 27500\nspeed_m_s = 0.02\nnormal_force_n = 0.25\n[[series]]\nspeed_m_s = [0.02]\n",
    ),
    (
        "fraction.toml",
        "name = \"a\"\nreplicates = 1.5\n[base]\namplitude_pp_m = 2e-6\nfrequency_hz = 27500\nspeed_m_s = 0.02\nnormal_force_n = 0.25\n[[series]]\nspeed_m_s = [0.02]\n",
    ),
    ("unclosed.toml", "name = \"a\"\n[base\nspeed_m_s = 0.02\n"),
    ("nothing.toml", ""),
    (
        "no-series.toml",
        "name = \"a\"\n[base]\namplitude_pp_m = 2e-6\nfrequency_hz = 27500\nspeed_m_s = 0.02\nnormal_force_n = 0.25\n",
    ),
    (
        "heavy.toml",
        "name = \"a\"\n[base]\namplitude_pp_m = 2e-6\nfrequency_hz = 27500\nspeed_m_s = 0.02\nnormal_force_n = 0.25\n[[series]]\nnormal_force_n = [9.0]\n",
    ),
    (
        "fast.toml",
        "name = \"a\"\n[base]\namplitude_pp_m = 2e-6\nfrequency_hz = 27500\nspeed_m_s = 0.02\nnormal_force_n = 0.25\n[[series]]\nspeed_m_s = [20]\n",
    ),
    (
        "large.toml",
        "name = \"a\"\n[base]\namplitude_pp_m = 2e-6\nfrequency_hz = 27500\nspeed_m_s = 0.02\nnormal_force_n = 0.25\n[[series]]\namplitude_pp_m = [2.0]\n",
    ),
    (
        "slow.toml",
        "name = \"a\"\n[base]\namplitude_pp_m = 2e-6\nfrequency_hz = 27500\nspeed_m_s = 0.02\nnormal_force_n = 0.25\n[[series]]\nfrequency_hz = [27.5]\n",
    ),
    (
        "words.toml",
        "name = \"a\"\n[base]\namplitude_pp_m = 2e-6\nfrequency_hz = 27500\nspeed_m_s = 0.02\nnormal_force_n = 0.25\n[[series]]\nspeed_m_s = \"fast\"\n",
    ),
    (
        "listless.toml",
        "name = \"a\"\n[base]\namplitude_pp_m = 2e-6\nfrequency_hz = 27500\nspeed_m_s = 0.02\nnormal_force_n = 0.25\n[[series]]\nspeed_m_s = 0.02\n",
    ),
    ("setup.toml", "name = \"mine\"\n[amplifier]\nprofile = \"no-such-instrument\"\n"),
    ("empty.csv", ""),
    ("words.csv", "a,b\nx,y\n"),
    ("weights.csv", "amp,F,FT,v\n1,2,3,4\n"),
    ("noise.mcap", "this is not a recording of a run, whatever its name says\n"),
    ("rig.toml", "[finger]\nnormal_stiffness_n_per_m = 3.9\n"),
];

/// What is typed, after `muprime`.
const TYPED: &[&str] = &[
    "rum",
    "run --fastest",
    "run --seed -1",
    "run --seed abc",
    "run nosuch --fast",
    "run --setup nosuch --fast",
    "run --fast --model nosuch.toml",
    "run --fast --model negative.toml",
    "run --fast --model words.csv",
    "run --fast --defects nosuch.toml",
    "run --fast --defects negative.toml",
    "run words.csv --fast",
    "run nothing.toml --fast",
    "run --fast --out words.csv",
    "run --fast --out runs/first --seed 9",
    "run --allow-control",
    "run --publish nonsense",
    "run --tui --dashboard",
    "check nosuch.toml",
    "check first-sweep --setup nosuch",
    "check misspelt.toml",
    "check negative.toml",
    "check fraction.toml",
    "check unclosed.toml",
    "check nothing.toml",
    "check no-series.toml",
    "check words.toml",
    "check listless.toml",
    "check heavy.toml --setup virtual",
    "check fast.toml --setup virtual",
    "check large.toml --setup virtual",
    "check slow.toml --setup virtual",
    "check setup.toml",
    "check rig.toml",
    "check noise.mcap",
    "diagnose nosuch",
    "diagnose nosuch.csv",
    "diagnose runs/first --rig nosuch.toml",
    "diagnose runs/first --rig rig.toml",
    "diagnose runs/first --without nosuch",
    "diagnose runs/first --predict words.csv",
    "diagnose words.csv --rig runs/first/rig.toml",
    "diagnose empty.csv --rig runs/first/rig.toml",
    "diagnose negative.toml --rig runs/first/rig.toml",
    "report nosuch",
    "replay nosuch",
    "replay noise.mcap",
    "recover nosuch.mcap",
    "recover noise.mcap",
    "recover runs",
    "export nosuch --to csv",
    "export runs/first --to pdf",
    "compare nosuch runs/first",
    "compare runs/first nosuch",
    "import nosuch.csv -o out",
    "import empty.csv -o out",
    "import words.csv -o out",
    "import words.csv -o out --map a=nosuch",
    "calibrate force nosuch.csv --operator A --serial S",
    "calibrate force weights.csv --operator A --serial S",
    "calibrate force empty.csv --operator A --serial S",
    "calibrate force weights.csv",
    "calibrate amplitude --table weights.csv --operator A --serial S",
    "doctor --setup nosuch",
    "doctor peek tcp:127.0.0.1:1 0..3",
    "doctor peek rtu:nosuch 0..3",
    "doctor peek rtu:nosuch 0..999",
    "doctor peek rtu:nosuch",
    "show nosuch",
    "init nosuch",
    "init plan --out words.csv",
    "schema nosuch",
    "doc profile nosuch",
    "completions nosuch",
    "model point --amplitude-pp-m 2",
    "model point --amplitude-pp-m 2furlong",
    "model point --speed-m-s 20",
    "model point --frequency-hz 27.5kN",
    "model point --normal-force-n 5000",
    "model point --mu0 -1",
    "model point --mu0 half",
    "model point --model nosuch",
    "model amplitude-for --mu-relative 2",
    "model effects nosuch",
    "model reproduce fig99",
    "faults --seeds abc",
];

fn given(folder: &Path, typed: &str, json: bool) -> Output {
    let mut command = muprime();
    command.args(typed.split(' ')).current_dir(folder).env("COLUMNS", "100").env("NO_COLOR", "1");
    command.env_remove("MUPRIME_RUNS").env_remove("MUPRIME_PROFILES").env_remove("MUPRIME_LOG");
    // The page is that of any machine.
    command.env("HOME", "/home/you").env_remove("XDG_CONFIG_HOME");
    if json {
        command.arg("--json");
    }
    command.output().unwrap()
}

/// What an answer has that is no word for people.
fn unfit(said: &str) -> Vec<&str> {
    const TYPES: [&str; 12] =
        ["u8", "u16", "u32", "u64", "usize", "i8", "i32", "i64", "f32", "f64", "struct", "variant"];
    const PARTS: [&str; 9] = [
        "os error",
        "Some(",
        "Err(",
        "::",
        "deserialize",
        "panicked",
        "float literal",
        "invalid digit",
        "0000000",
    ];
    let words = said.split(|c: char| !c.is_alphanumeric() && c != '_');
    let types =
        words.filter(|w| TYPES.contains(w) || (w.len() > 12 && w.chars().all(|c| c.is_ascii_digit())));
    types.chain(PARTS.into_iter().filter(|p| said.contains(p))).collect()
}

/// The sentences of a document of an error, or of a checked file.
fn sentences(document: &serde_json::Value) -> Vec<String> {
    let mut all = Vec::new();
    let mut take = |value: &serde_json::Value| {
        if let Some(text) = value.as_str().filter(|text| !all.contains(&(*text).to_string())) {
            all.push(text.to_string());
        }
    };
    take(&document["error"]);
    take(&document["problem"]);
    document["causes"].as_array().into_iter().flatten().for_each(&mut take);
    take(&document["help"]);
    for problem in document["problems"].as_array().into_iter().flatten() {
        take(&problem["problem"]);
        take(&problem["remedy"]);
        take(&problem["help"]);
    }
    all
}

/// The page: what was typed and what was answered. And what is wrong with the answers.
pub fn page() -> (String, Vec<String>) {
    let folder = tempfile::tempdir().unwrap();
    let made = given(folder.path(), "run --fast --out runs/first", false);
    assert_eq!(made.status.code(), Some(0), "{}", texts(&made).1);
    for (name, text) in FILES {
        std::fs::write(folder.path().join(name), text).unwrap();
    }
    let mut page = format!(
        "# Error messages\n\n{} errors as people make them, each with the answer of the program. Every answer ends with exit status 2: \
         nothing was touched. `tests/docs.rs` provokes each one and generates this page. At a terminal the answer also shows the place in the file.\n\n\
         ## The files\n\n",
        TYPED.len()
    );
    for (name, text) in FILES.iter().filter(|(_, text)| text.contains('\n') && text.len() < 240) {
        page.push_str(&format!("- `{name}`: `{}`\n", text.trim_end().replace('\n', " ⏎ ")));
    }
    page.push_str("\n## The answers\n\n| `muprime ...` | answers |\n|---|---|\n");
    let mut wrong = Vec::new();
    for typed in TYPED {
        let output = given(folder.path(), typed, false);
        let (out, err) = texts(&output);
        let said = format!("{out}{err}");
        let unfit = unfit(&said);
        if output.status.code() != Some(2) || !unfit.is_empty() || said.trim().is_empty() {
            wrong.push(format!("muprime {typed}: status {:?}, {unfit:?}:\n{said}", output.status.code()));
        }
        let (out, _) = texts(&given(folder.path(), typed, true));
        let document =
            out.lines().next().and_then(|line| serde_json::from_str(line).ok()).unwrap_or_default();
        let told = sentences(&document)
            .join(". ")
            .replace('\n', " ")
            .replace('|', "\\|")
            .replace('<', "&lt;")
            .replace(".. ", ". ");
        page.push_str(&format!(
            "| `{typed}` | {} |\n",
            told.split_whitespace().collect::<Vec<_>>().join(" ")
        ));
    }
    (page, wrong)
}
