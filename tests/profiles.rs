//! Profiles that a laboratory writes: those of docs/profiles.md hold, the program finds them, and their pages say what they read.

use drivers::user_profiles::Source;
use std::process::Stdio;
use tests::file;
use tests::peer::start;

/// The files of the page.
const EXAMPLES: [&str; 4] = ["bench-board", "strain-amp", "ascii-generator", "can-force"];

fn source(name: &str) -> Source {
    Source::read(&file(&format!("docs/profiles/{name}.toml"))).unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn the_examples_hold_and_the_page_shows_what_they_say() {
    let page = std::fs::read_to_string(file("docs/profiles.md")).unwrap();
    let texts: Vec<String> = EXAMPLES.iter().map(|name| source(name).text).collect();
    for name in EXAMPLES {
        runs::profile_trial::of(&file(&format!("docs/profiles/{name}.toml")))
            .unwrap_or_else(|said| panic!("{said}"));
        assert!(page.contains(&format!("(profiles/{name}.toml)")), "the page does not link {name}");
    }
    let mut shown = 0;
    for block in page.split("```toml\n").skip(1) {
        let block = block.split("```").next().unwrap().trim_end();
        assert!(texts.iter().any(|text| text.contains(block)), "in no example:\n{block}");
        shown += 1;
    }
    assert!(shown >= 8, "{shown} excerpts");
    // What a profile may name of the virtual world stands there too.
    let measured = sim::wire::quantity::Quantity::ALL.iter().map(|quantity| quantity.name());
    let commanded = sim::wire::quantity::Command::ALL.iter().map(|command| command.name());
    for name in measured.chain(commanded) {
        assert!(page.contains(&format!("`{name}`")), "the page does not tell of {name}");
    }
}

/// The page on a profile of one's own says what it reads and writes.
#[test]
fn a_page_on_a_profile() {
    let doc = |what: &str| {
        let output = tests::muprime().args(["doc", "profile", what]).output().unwrap();
        (output.status.code(), tests::texts(&output))
    };
    let (status, (page, _)) = doc(file("docs/profiles/ascii-generator.toml").to_str().unwrap());
    assert_eq!(status, Some(0));
    for said in
        ["# ascii-generator", "STATE?", "`F={echo_frequency:.1}Hz", "ALARM {code:x}", "its manual, chapter"]
    {
        assert!(page.contains(said), "{said} is not in\n{page}");
    }
    let (status, (page, _)) = doc("labjack-t7");
    assert_eq!(status, Some(0));
    for said in ["registers 0 to 1, 4 to 5", "60000", "43900", "resolution unknown"] {
        assert!(page.contains(said), "{said} is not in\n{page}");
    }
    let (status, (_, said)) = doc("no-such-thing");
    assert!(status == Some(2) && said.contains("labjack-t7"), "{said}");
}

/// A setup over `server` whose force sensor is one of the page's, described by `profile`.
fn setup_with(profile: &str, address: &str) -> String {
    let server: std::net::SocketAddr = "127.0.0.1:1502".parse().unwrap();
    let text = tests::served::setup("own", server);
    let force = format!("profile = \"muprime-force2\"\naddress = \"{server}\"");
    assert!(text.contains(&force), "{text}");
    text.replacen(&force, &format!("profile = \"{profile}\"\naddress = \"{address}\""), 1)
}

/// From a folder, by path, or not at all: `check`, `virtual-rig` and their status.
#[test]
fn the_program_finds_profiles_where_it_is_told_to_look() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let (home, shelf) = (at("home"), at("shelf"));
    std::fs::create_dir_all(home.join("muprime/profiles")).unwrap();
    std::fs::create_dir_all(&shelf).unwrap();
    let virtual_one =
        setup_with("bench-board", "pty").replace("127.0.0.1:1502", "127.0.0.1:0") + "[virtual]\n";
    std::fs::write(at("setup.toml"), virtual_one).unwrap();
    let command = |arguments: &[&str]| {
        let mut command = tests::muprime();
        command.env("XDG_CONFIG_HOME", &home).args(arguments);
        command
    };
    let check = |more: &[&str]| {
        let output = command(more).arg("check").arg(at("setup.toml")).output().unwrap();
        (
            output.status.code(),
            tests::texts(&output).1.replace('│', "").split_whitespace().collect::<Vec<_>>().join(" "),
        )
    };
    let (status, said) = check(&[]);
    assert_eq!(status, Some(2), "{said}");
    assert!(said.contains("no profile is called `bench-board`") && said.contains("looked in:"), "{said}");
    let board = file("docs/profiles/bench-board.toml");
    std::fs::copy(&board, shelf.join("bench-board.toml")).unwrap();
    let (status, said) = check(&["--profiles", shelf.to_str().unwrap()]);
    assert_eq!(status, Some(0), "{said}");
    std::fs::copy(&board, home.join("muprime/profiles/bench-board.toml")).unwrap();
    let (status, said) = check(&[]);
    assert_eq!(status, Some(0), "{said}");
    let setup = at("setup.toml");
    let mut served = command(&["--json", "virtual-rig", "--modbus-tcp", "127.0.0.1:0", "--setup"]);
    let (_rig, places) = start(served.arg(&setup).stderr(Stdio::null()));
    assert!(places.contains("bench-board at /dev/pts"), "{places}");
    // A profile that is wrong is refused with file and line, by the setup's own check.
    let wrong = source("bench-board").text.replacen("\"CRC-16/XMODEM\"", "\"CRC-16/XMODEN\"", 1);
    std::fs::write(home.join("muprime/profiles/bench-board.toml"), wrong).unwrap();
    let (status, said) = check(&[]);
    assert_eq!(status, Some(2), "{said}");
    assert!(said.contains("CRC-16/MODBUS") && said.contains("line "), "{said}");
}

/// What a float's count is worth was read off its type: 1 N, so that every sweep was refused.
#[test]
fn a_float_sensor_is_judged_by_its_stated_resolution_or_not_by_its_count() {
    let folder = tempfile::tempdir().unwrap();
    let text = source("strain-amp").text;
    let count = |text: &str| {
        std::fs::write(folder.path().join("amp.toml"), text).unwrap();
        let setup = setup_with("amp.toml", "127.0.0.1:1502");
        let setup =
            runs::setup::Setup::parse("own", &setup, folder.path()).unwrap_or_else(|e| panic!("{e:?}"));
        setup.lateral_channel().unwrap().count_n
    };
    assert_eq!(count(&text), Some(2e-4));
    let unstated: Vec<&str> = text.lines().filter(|line| !line.starts_with("resolution_si")).collect();
    assert_eq!(count(&unstated.join("\n")), None);
}
