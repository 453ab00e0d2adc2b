//! An example for every command: it stands under `--help` and in the manual, and a test parses each.

use runs::print::{COLUMNS, folded};

/// Commands with their examples, a line each. Add one with every subcommand.
pub const EXAMPLES: &[(&str, &str)] = &[
    (
        "run",
        "muprime run\nmuprime run my-plan.toml --setup my-setup.toml --out runs/monday\nmuprime run --tui --operator Ada\nmuprime run --fast --seed 7 --model MODEL.toml\nmuprime run --fast --model psi\nmuprime run part2-campaign --fast --out campaign",
    ),
    ("virtual-rig", "muprime virtual-rig --modbus-tcp 127.0.0.1:1502"),
    ("calibrate force", "muprime calibrate force weights.csv --operator 'A. Smith' --serial SN1"),
    (
        "calibrate amplitude",
        "muprime calibrate amplitude --table vibrometer.csv --operator 'A. Smith' --serial SN2",
    ),
    (
        "calibrate latency",
        "muprime calibrate latency --edges force=edges.csv --operator 'A. Smith' --serial SN1",
    ),
    (
        "calibrate phase",
        "muprime calibrate phase w1.csv w2.csv --rate-hz 1e6 --operator 'A. Smith' --serial tip-3",
    ),
    (
        "calibrate finger",
        "muprime calibrate finger PHASES.csv --operator 'A. Smith' --serial tip-3\n\
        muprime calibrate finger --passes runs/monday/points.csv --operator 'A. Smith' --serial tip-3",
    ),
    ("calibrate creep", "muprime calibrate creep creep.csv --operator 'A. Smith' --serial SN1"),
    ("calibrate gravity", "muprime calibrate gravity tilts.csv --operator 'A. Smith' --serial SN1"),
    ("calibrate noise", "muprime calibrate noise rest.csv --rate-hz 1000 --operator 'A. Smith' --serial SN1"),
    ("calibrate step", "muprime calibrate step steps.csv --operator 'A. Smith' --serial SN1"),
    ("calibrate tap", "muprime calibrate tap taps.csv --operator 'A. Smith' --serial SN1"),
    ("calibrate priors", "muprime calibrate priors force-SN1.toml amplitude-SN2.toml"),
    (
        "check",
        "muprime check my-setup.toml my-plan.toml\nmuprime check my-plan.toml --setup my-setup.toml\nmuprime check first-sweep --setup virtual",
    ),
    ("doctor", "muprime doctor\nmuprime doctor --setup my-setup.toml --instruments-only"),
    (
        "doctor peek",
        "muprime doctor peek rtu:/dev/ttyUSB0 100..103 --unit 3\nmuprime doctor peek tcp:192.168.1.20:502 0..11 --table input\nmuprime doctor peek can0\nmuprime doctor peek /dev/ttyUSB0 --baud 115200",
    ),
    (
        "diagnose",
        "muprime diagnose runs/monday\nmuprime diagnose points.csv --rig rig.toml --report out.html --save-model MODEL.toml",
    ),
    ("blind", "muprime blind --sets 20"),
    ("faults", "muprime faults --seeds 500"),
    #[cfg(feature = "parquet")]
    (
        "cases ridge",
        "muprime cases ridge --draw 2000 --elements 200 --span amplitude_pp_m=0.3e-6..5e-6:log --span mu0=0.2..1 -o ridge.jsonl\nmuprime cases ridge --from conditions.csv -o ridge.jsonl",
    ),
    #[cfg(feature = "parquet")]
    ("cases table", "muprime cases table -o table.jsonl"),
    #[cfg(feature = "parquet")]
    ("cases faults", "muprime cases faults --seeds 1000000 --pairs -o faults.jsonl"),
    #[cfg(feature = "parquet")]
    ("cases blind", "muprime cases blind --sets 100000 --seed 7 -o blind.jsonl"),
    #[cfg(feature = "parquet")]
    (
        "cases diagnose",
        "muprime cases diagnose runs/monday runs/tuesday -o archive.jsonl\nmuprime cases diagnose --list tables.txt --rig rig.toml -o archive.jsonl",
    ),
    #[cfg(feature = "parquet")]
    ("cases finger", "muprime cases finger finger-1.csv finger-2.csv --modulus-only -o fingers.jsonl"),
    #[cfg(feature = "parquet")]
    ("cases noop", "muprime cases noop --cases 100000 -o noop.jsonl"),
    #[cfg(feature = "parquet")]
    (
        "case",
        "muprime case --cases ridge.jsonl --index 17 --out study\nmuprime case --cases ridge.jsonl --range 0..100 --out study --threads 1",
    ),
    #[cfg(feature = "parquet")]
    (
        "submit",
        "muprime submit ridge.jsonl --out study\nmuprime submit ridge.jsonl --out study --engine slurm --option=--partition=short\nmuprime submit --cancel --out study",
    ),
    #[cfg(feature = "parquet")]
    ("gather", "muprime gather study -o study.parquet"),
    (
        "import",
        "muprime import sweep.csv -o sweep\n\
        muprime import sweep.csv --map 'amp=amplitude_pp:um, F=normal_force:N, FT=lateral_force:N, v=velocity:mm/s, t=time:s' --set frequency_hz=27500 -o sweep\n\
        muprime import pins.xlsx --sheet Friction --map 't=time:s, mu=friction_coefficient' --set amplitude_pp_m=0,speed=10:mm/s,direction=1,normal_force=5:N -o pins\n\
        muprime import stroke.txt --series --map 't=time:s, x=position:mm, Fz=normal_force:-N, Fx=lateral_force:N' --set amplitude_pp_m=0 -o stroke",
    ),
    ("schema", "muprime schema plan"),
    ("init", "muprime init setup\nmuprime init plan --out my-plan.toml"),
    ("show", "muprime show\nmuprime show first-sweep\nmuprime show --sample moist --out moist"),
    ("doc profile", "muprime doc profile my-sensor.toml\nmuprime doc profile labjack-t7"),
    ("man", "muprime man man1"),
    ("model point", "muprime model point --amplitude-pp-m 3e-6 --speed-m-s 0.01 --json"),
    ("model ridge", "muprime model ridge --amplitude-pp-m 2e-6 --elements 200"),
    ("model table", "muprime model table --out study --threads 2"),
    #[cfg(feature = "parquet")]
    (
        "model adapt",
        "muprime model adapt --out surrogate --span amplitude_pp_m=0.3e-6..5e-6:log --span mu0=0.2..1 --nodes 2000",
    ),
    (
        "model tabulate",
        "muprime model tabulate --command 'awk -F, -f law.awk' --grid amplitude_pp_m=0.2e-6..6e-6:25:log --grid speed_m_s=0.002..0.2:17:log --out law.csv",
    ),
    ("model reproduce", "muprime model reproduce fig14 --out figures"),
    ("model stiffness", "muprime model stiffness\nmuprime model stiffness --survey --elements 200"),
    ("model patch", "muprime model patch --elements 200"),
    ("model effects", "muprime model effects squeeze_film"),
    ("model amplitude-for", "muprime model amplitude-for --mu-relative 0.4 --speed-m-s 0.02"),
    ("report", "muprime report runs/monday"),
    ("compare", "muprime compare runs/first runs/second --report both.html"),
    ("replay", "muprime replay runs/monday"),
    ("export", "muprime export runs/monday --to parquet"),
    ("recover", "muprime recover runs/monday/run-1.mcap"),
    ("runs", "muprime runs --unfinished"),
    ("watch", "muprime watch\nmuprime watch runs/monday --json"),
    ("dashboard", "muprime dashboard\nmuprime dashboard --folder runs --listen 127.0.0.1:0 --allow-control"),
    ("completions", "muprime completions bash"),
];

/// The examples of a command, as the end of its help.
fn help_of(path: &str) -> Option<String> {
    let (_, lines) = EXAMPLES.iter().find(|(p, _)| *p == path)?;
    let head = if lines.contains('\n') { "Examples:" } else { "Example:" };
    Some(format!("{head}\n{}", lines.lines().map(|l| broken(l.trim_start())).collect::<Vec<_>>().join("\n")))
}

/// A command line as a shell takes it within the columns of a page: broken between its words with a backslash, and within quotes as it is,
/// which the map of an import does not mind.
fn broken(line: &str) -> String {
    let (mut shown, mut now, mut quoted) = (String::new(), String::from("  "), false);
    for word in line.split(' ') {
        // Room for the blank and the backslash.
        if !now.trim_start().is_empty() && now.chars().count() + 1 + word.chars().count() > COLUMNS - 2 {
            shown.push_str(&now);
            shown.push_str(if quoted { "\n" } else { " \\\n" });
            now = " ".repeat(6);
            now.push_str(word);
        } else {
            if !now.trim_start().is_empty() {
                now.push(' ');
            }
            now.push_str(word);
        }
        quoted ^= word.matches('\'').count() % 2 == 1;
    }
    shown + &now
}

/// A command with its examples, and those of its subcommands.
pub fn with_examples(command: clap::Command) -> clap::Command {
    put(command, "")
}

fn put(mut command: clap::Command, path: &str) -> clap::Command {
    let names: Vec<String> = command.get_subcommands().map(|s| s.get_name().to_string()).collect();
    for name in names {
        let path = if path.is_empty() { name.clone() } else { format!("{path} {name}") };
        command = command.mut_subcommand(&name, |sub| put(sub, &path));
    }
    if let Some(usage) = short_usage(&command, path) {
        command = command.override_usage(usage);
    }
    match help_of(path) {
        Some(text) => command.after_help(text),
        None => command,
    }
}

/// The usage of a command, folded where it is longer than a line: clap folds every other part of a page.
fn short_usage(command: &clap::Command, path: &str) -> Option<String> {
    const HEAD: &str = "Usage: ";
    let usage = command.clone().bin_name(format!("muprime {path}")).render_usage().to_string();
    let usage = usage.strip_prefix(HEAD)?;
    if usage.contains('\n') || HEAD.len() + usage.chars().count() <= COLUMNS {
        return None;
    }
    // A flag stays with its value.
    let words = usage.replace(" <", "\u{a0}<");
    let whole = folded(&format!("{HEAD}{words}"), HEAD.len());
    Some(whole.trim_start_matches(HEAD).replace('\u{a0}', " "))
}
