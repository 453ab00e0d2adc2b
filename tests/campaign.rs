//! A campaign from its file to the answers on its page.

use models::SpringSlider;
use rayon::prelude::*;
use runs::campaign::{self, Campaign};
use runs::{Job, Signals};
use std::collections::BTreeMap;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::Arc;
use studies::campaign::claims::{Claim, ClaimAnswer, Trend, claims, trend};
use tests::muprime;

/// The bundled campaign on a rig that is the spring-slider, with a seed and blocks of its own.
fn ideal(seed: u64, blocks: u32) -> Campaign {
    let text = campaign::BUNDLED[0].1;
    let text = text
        .replace("setup = \"virtual\"", "setup = \"virtual-ideal\"")
        .replace("seed = 2", &format!("seed = {seed}"));
    // One repeat a session is quick, and decides less.
    let text = text.replace("replicates = 2 ", "replicates = 1 ");
    Campaign::parse("ideal", &text.replace("blocks = 3 ", &format!("blocks = {blocks} ")), Path::new("."))
        .unwrap()
}

/// Its answers on a virtual rig with these defects.
fn answers(campaign: &Campaign, defects: &str) -> Vec<Claim> {
    let folder = tempfile::tempdir().unwrap();
    let job = |session: campaign::CampaignRun| {
        let setup = campaign.setups[session.cell].clone();
        Job {
            model: Arc::new(SpringSlider::new(setup.tip.finger).unwrap()),
            setup,
            plan: campaign.plan.clone(),
            seed: session.seed,
            model_file: None,
            defects: Some(sim::defects::Defects::parse(defects).unwrap()),
            out: folder.path().join(&session.folder),
            fast: true,
            notes: Default::default(),
            answers: None,
        }
    };
    let sessions = campaign::sessions(&campaign.file);
    campaign.open(folder.path(), &job(sessions[0].clone()).identity()).unwrap();
    for session in sessions {
        job(session).run_in_virtual_time(&Signals::default(), &mut |_| {}).unwrap();
    }
    let (file, made) = studies::campaign::measured(folder.path()).unwrap();
    assert_eq!(made.len(), campaign::sessions(&file).len());
    claims(&made, file.margin)
}

/// Every statement on three natures of the virtual rig, beside the change that the mean of all campaigns of a
/// nature shows: an answer is wrong where the true change lies beyond the margin on another side, and it is
/// owed where the true change is nil or twice the margin.
#[test]
fn answers_are_right_on_three_natures() {
    let natures = [
        ("as the paper says", ""),
        (
            "squeeze film",
            "[[defect]]\nname = \"squeeze_film\"\nparameters = { film_area_m2 = 8e-6, half_gap_m = 2.5e-6, asperity_load_n = 1.0 }\n",
        ),
        ("load-dependent friction", "[[defect]]\nname = \"load_dependent_friction\"\nseed = 3\n"),
    ];
    // By default the two whose answers are known beforehand.
    let natures = &natures[..tests::rounds(2, 3)];
    let rounds = tests::rounds(1, 50);
    let (mut wrong, mut said, mut owed, mut decided) = (0, 0, 0, 0);
    let campaigns = (0..natures.len() * rounds).into_par_iter();
    let answer = |i: usize| answers(&ideal(100 + (i % rounds) as u64, 2), natures[i / rounds].1);
    let mut answered: Vec<Vec<Claim>> = campaigns.map(answer).collect();
    for &(nature, _) in natures {
        let mut found = BTreeMap::<&str, Vec<Claim>>::new();
        let all: Vec<Vec<Claim>> = answered.drain(..rounds).collect();
        for claim in all.into_iter().flatten() {
            found.entry(claim.name).or_default().push(claim);
        }
        println!("{nature}:");
        for (name, all) in &found {
            let changes: Vec<f64> = all.iter().filter_map(|c| c.effect.map(|e| e.change)).collect();
            let truth = changes.iter().sum::<f64>() / changes.len() as f64;
            let margin = all[0].margin;
            let count = |answer: ClaimAnswer| all.iter().filter(|c| c.answer == answer).count();
            let is = trend([truth, truth], margin);
            let right =
                if is == Some(all[0].expected) { ClaimAnswer::Supported } else { ClaimAnswer::Contradicted };
            let other = if right == ClaimAnswer::Supported {
                ClaimAnswer::Contradicted
            } else {
                ClaimAnswer::Supported
            };
            println!(
                "  {name:<20} true change {truth:+.3}: supported {}, contradicted {}, undecided {}",
                count(ClaimAnswer::Supported),
                count(ClaimAnswer::Contradicted),
                count(ClaimAnswer::Undecided)
            );
            // Known without any campaign: the ratchet's dependences, and whether a film of air is there.
            let known = match *name {
                "amplitude" | "frequency" | "speed" | "mu_0" => Some(ClaimAnswer::Supported),
                "ambient pressure" if nature == "squeeze film" => Some(ClaimAnswer::Contradicted),
                "ambient pressure" => Some(ClaimAnswer::Supported),
                _ => None,
            };
            assert!(known.is_none_or(|known| 10 * count(known) >= 8 * all.len()), "{nature}: {name}");
            if changes.is_empty() {
                continue;
            }
            (said, wrong) = (said + all.len(), wrong + count(other));
            // Four cells leave one or two degrees of freedom between tips: no answer is owed there.
            let between = ["modulus", "human and artificial"].contains(name);
            if !between && (truth.abs() < 0.2 * margin || truth.abs() > 2.0 * margin) {
                (owed, decided) = (owed + all.len(), decided + all.len() - count(ClaimAnswer::Undecided));
            }
        }
    }
    println!("wrong {wrong} of {said}; decided {decided} of {owed} that are owed");
    assert!(wrong as f64 <= 0.02 * f64::from(said as u32), "{wrong} of {said}");
    assert!(decided as f64 >= 0.8 * f64::from(owed as u32), "{decided} of {owed}");
}

/// Three days of one silicone tip and of one human tip: with a human tip of 0.8 times the lateral
/// stiffness, within its stated deviation, 'contradicted', and with the nominal one 'supported'. Both were
/// decided by the days of one tip.
#[test]
fn days_of_one_tip_do_not_tell_how_kinds_of_tips_differ() {
    let text = ideal(5, 3).text;
    let cells: Vec<&str> = text.split("\n[[cell]]\n").collect();
    let text = [cells[0], cells[1], cells[3]].join("\n[[cell]]\n");
    let campaign = Campaign::parse("ideal", &text, Path::new(".")).unwrap();
    let claims = answers(&campaign, "");
    for name in ["human and artificial", "modulus", "mu_0"] {
        let claim = claims.iter().find(|claim| claim.name == name).unwrap();
        assert_eq!((claim.answer, claim.effect), (ClaimAnswer::Undecided, None), "{claim:?}");
    }
    assert_eq!(claims[0].answer, ClaimAnswer::Supported, "{:?}", claims[0]);
}

/// What is complete is not made again, a copy of the folder answers the same, another campaign is refused
/// there, and one session alone decides nothing.
#[test]
fn a_campaign_is_taken_up_where_it_was_left() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let text = campaign::BUNDLED[0]
        .1
        .replace("blocks = 3 ", "blocks = 1 ")
        .replace("replicates = 2 ", "replicates = 1 ");
    std::fs::write(at("short.toml"), &text).unwrap();
    let run = |what: &[&str]| {
        let out = muprime().current_dir(folder.path()).args(what).output().unwrap();
        (out.status.code(), String::from_utf8(out.stdout).unwrap(), String::from_utf8(out.stderr).unwrap())
    };
    let (status, out, _) = run(&["run", "short.toml", "--fast", "--out", "made", "--json"]);
    assert_eq!(status, Some(0));
    let last: serde_json::Value = serde_json::from_str(out.lines().last().unwrap()).unwrap();
    assert_eq!((&last["campaign"]["sessions"], &last["campaign"]["planned"]), (&4.into(), &4.into()));
    let answer = |claim: &serde_json::Value| claim["answer"].as_str().unwrap().to_string();
    assert_eq!(answer(&last["campaign"]["claims"][0]), "supported", "{last}");
    let page = std::fs::read_to_string(at("made/campaign.html")).unwrap();

    // A session that was not completed is made again, and only that one.
    let sessions: Vec<_> =
        std::fs::read_dir(at("made/sessions")).unwrap().map(|e| e.unwrap().path()).collect();
    std::fs::remove_dir_all(&sessions[1]).unwrap();
    let (_, _, told) = run(&["report", "made"]);
    assert!(told.contains("3 of 4 sessions") && told.contains("repeat the command"), "{told}");
    let (status, _, told) = run(&["run", "made", "--fast"]);
    assert_eq!(status, Some(0), "{told}");
    assert_eq!(told.matches("session ").count(), 1, "{told}");
    assert_eq!(
        std::fs::read_to_string(at("made/campaign.html")).unwrap(),
        page,
        "the same seeds, the same page"
    );

    std::fs::rename(at("made"), at("copied")).unwrap();
    std::fs::remove_file(at("copied/campaign.html")).unwrap();
    assert_eq!(run(&["report", "copied"]).0, Some(0));
    assert_eq!(std::fs::read_to_string(at("copied/campaign.html")).unwrap(), page);

    std::fs::write(at("other.toml"), text.replace("seed = 2", "seed = 3")).unwrap();
    let (status, _, told) = run(&["run", "other.toml", "--fast", "--out", "copied"]);
    assert!(status == Some(2) && told.contains("another campaign"), "{told}");
    let (status, _, told) = run(&["check", "other.toml"]);
    assert!(status == Some(0) && told.contains("campaign"), "{told}");

    // One session: how sessions differ is not known, so nothing is decided.
    std::fs::write(at("one.toml"), text.split("[[cell]]").take(2).collect::<Vec<_>>().join("[[cell]]"))
        .unwrap();
    let (_, out, _) = run(&["run", "one.toml", "--fast", "--out", "one", "--json"]);
    let last: serde_json::Value = serde_json::from_str(out.lines().last().unwrap()).unwrap();
    let all = last["campaign"]["claims"].as_array().unwrap();
    assert!(all.iter().all(|claim| answer(claim) == "undecided"), "{last}");
}

/// A campaign with files of its own goes on by its folder, and not with a plan, setup or tip that was
/// changed meanwhile.
#[test]
fn a_campaign_goes_on_with_the_files_that_it_began_with() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    tests::short_plan(folder.path());
    std::fs::write(at("own.toml"), tests::setup("virtual-ideal").text).unwrap();
    std::fs::write(at("tip.toml"), runs::fingertip::BUNDLED[0].1).unwrap();
    let cell =
        |name: &str| format!("[[cell]]\nname = \"{name}\"\nsetup = \"own.toml\"\ntip = \"tip.toml\"\n");
    let text = format!("name = \"own\"\nplan = \"short.toml\"\nblocks = 1\n{}{}", cell("a"), cell("b"));
    std::fs::write(at("own-campaign.toml"), text).unwrap();
    let run = |what: &[&str]| {
        let out = muprime().current_dir(folder.path()).args(what).output().unwrap();
        (out.status.code(), String::from_utf8(out.stderr).unwrap())
    };
    let (status, told) = run(&["run", "own-campaign.toml", "--fast", "--out", "deep/made"]);
    assert_eq!(status, Some(0), "{told}");
    let first = std::fs::read_dir(at("deep/made/sessions")).unwrap().next().unwrap().unwrap().path();
    std::fs::remove_dir_all(&first).unwrap();
    for (what, from, to) in [
        ("short.toml", "settle_s = 0.08", "settle_s = 0.09"),
        ("own.toml", "name = \"virtual-ideal\"", "name = \"another\""),
        ("tip.toml", "mu0 = 0.", "mu0 = 0.1"),
    ] {
        let was = std::fs::read_to_string(at(what)).unwrap();
        assert!(was.contains(from), "{what}: {was}");
        std::fs::write(at(what), was.replacen(from, to, 1)).unwrap();
        let (status, told) = run(&["run", "deep/made", "--fast"]);
        let told = told.split_whitespace().filter(|word| *word != "│").collect::<Vec<_>>().join(" ");
        assert!(status == Some(2) && told.contains(what) && told.contains("changed after session"), "{told}");
        assert!(!first.exists());
        std::fs::write(at(what), was).unwrap();
    }
    let (status, told) = run(&["run", "deep/made", "--fast"]);
    assert!(status == Some(0) && told.contains("2 of 2 sessions"), "{told}");
}

/// A Ctrl-C between two sessions was lost: all later ones were made, with status 0.
#[test]
fn a_stop_between_two_sessions_ends_the_campaign() {
    let folder = tempfile::tempdir().unwrap();
    tests::short_plan(folder.path());
    let text = "name = \"own\"\nplan = \"short.toml\"\nblocks = 4\n[[cell]]\nname = \"a\"\nsetup = \"virtual-ideal\"\n";
    std::fs::write(folder.path().join("own.toml"), text).unwrap();
    let mut child = muprime()
        .current_dir(folder.path())
        .args(["run", "own.toml", "--fast"])
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut told = Vec::new();
    for line in BufReader::new(child.stderr.take().unwrap()).lines().map(Result::unwrap) {
        // The last line of the first session.
        if line.contains("report: ") && told.iter().all(|before: &String| !before.contains("report: ")) {
            assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
        }
        told.push(line);
    }
    let told = told.join("\n");
    assert_eq!(child.wait().unwrap().code(), Some(1), "{told}");
    assert!(!told.contains("session 3 of 4") && !told.contains("leaving at once"), "{told}");
    assert!(told.contains("repeat the command: muprime run own.toml --fast --out="), "{told}");
}

/// What a campaign cannot be is refused with its place, and nothing is made.
#[test]
fn a_campaign_that_cannot_be_is_refused() {
    let text = campaign::BUNDLED[0].1;
    let refused = |from: &str, to: &str| {
        assert!(text.contains(from), "{from}");
        let changed = Campaign::parse("c.toml", &text.replacen(from, to, 1), Path::new("."));
        format!("{:?}", changed.err().unwrap_or_else(|| panic!("{to} is taken")))
    };
    for (from, to, says) in [
        ("blocks = 3", "blocks = 0", "sessions"),
        ("margin = 0.02", "margin = 5", "margin"),
        ("\"silicone-low-friction\"", "\"silicone\"", "two cells"),
        ("\"silicone-low-friction\"", "\"../out\"", "letters"),
        ("tip = \"human-index-dry\"", "tip = \"nobody\"", "nobody"),
        ("plan = \"part2-validation\"", "plan = \"none.toml\"", "none.toml"),
        ("replicates = 2", "replicates = 0", "replicates"),
        ("condition = \"moist\"", "conditions = \"moist\"", "conditions"),
    ] {
        let told = refused(from, to);
        assert!(told.contains(says), "{to}: {told}");
    }
}

/// The rule, at its edges.
#[test]
fn an_interval_across_the_margin_is_undecided() {
    assert_eq!(trend([-0.2, -0.06], 0.05), Some(Trend::Falls));
    assert_eq!(trend([-0.2, -0.04], 0.05), None);
    assert_eq!(trend([-0.04, 0.04], 0.05), Some(Trend::Same));
    assert_eq!(trend([0.06, 0.1], 0.05), Some(Trend::Rises));
    assert_eq!(trend([f64::NAN, 0.01], 0.05), None);
}
