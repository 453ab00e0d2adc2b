//! `muprime run CAMPAIGN.toml`: the sessions of a campaign that are missing, then its page.

use super::{Args, folder as folder_of, job_of, measure, serve, watched};
use crate::verbs::prelude::*;
use runs::Job;
use runs::campaign::{self, Campaign};
use std::sync::atomic::Ordering;
use studies::campaign::claims::Claim;

/// The page of a campaign, in its folder.
pub const PAGE: &str = "campaign.html";

/// Measures what is missing. On a virtual rig every session; on a rig with instruments one, since a person
/// changes the tip. A refusal comes before anything was measured: any session that a setup cannot do among
/// them.
pub fn run(mut args: Args, text: &str, folder: &Path, json: bool) -> miette::Result<ExitCode> {
    if args.seed.is_some() {
        let help = "state `seed` in the campaign's file";
        miette::bail!(help = help, "--seed is that of one run; a campaign has its own");
    }
    let resumed = Path::new(&args.plan).is_dir().then(|| PathBuf::from(&args.plan));
    let file = resumed
        .as_ref()
        .map_or_else(|| args.plan.clone(), |of| of.join(campaign::FILE).display().to_string());
    let campaign = Campaign::parse(&file, text, folder).map_err(|why| match &resumed {
        // Its plan and setups are not beside the text, where a check would look for them.
        Some(_) => why,
        None => tables::check::refusal(why, &file, "campaign"),
    })?;
    let is_named = args.out.is_some() || resumed.is_some();
    let (out, _made) = folder_of(args.out.take().or(resumed), &campaign.file.name)?;
    let given = args.clone();
    let job = |session: &campaign::CampaignRun| -> miette::Result<Job> {
        let cell = &campaign.file.cell[session.cell];
        let setup = campaign.setups[session.cell].clone();
        let mut job = job_of(&given, setup, campaign.plan.clone(), session.seed, out.join(&session.folder))?;
        let words = [cell.name.as_str(), &cell.condition].join(", ");
        job.notes.sample = job.notes.sample.or_else(|| Some(words.trim_end_matches(", ").to_string()));
        Ok(job)
    };
    let all = campaign::sessions(&campaign.file);
    // A session that cannot be done is refused before the first one is made.
    for session in all.iter().take(campaign.file.cell.len()) {
        job(session)?.points()?;
    }
    campaign.open(&out, &job(&all[0])?.identity())?;
    serve(&mut args, &out.join("sessions"))?;
    // One for all sessions: a stop between two of them is heard before the next one.
    let (signals, mut whole) = (watched()?, true);
    for session in all.iter().filter(|session| !campaign::is_complete(&out.join(&session.folder))) {
        if signals.stops.load(Ordering::Relaxed) > 0 {
            whole = false;
            break;
        }
        let cell = &campaign.file.cell[session.cell];
        let job = job(session)?;
        let instruments = !job.fast && job.setup.file.virtual_rig.is_none();
        if !json {
            let campaign::CampaignRun { number, block, .. } = session;
            let (comma, condition) = (if cell.condition.is_empty() { "" } else { ", " }, &cell.condition);
            say!("session {number} of {}, block {block}: {}{comma}{condition}", all.len(), cell.name);
        }
        let planned = job.points()?.len();
        whole = measure(job, planned, &args, &signals, json)?;
        if !whole || instruments {
            break;
        }
    }
    let (claims, made, _) = write(&out)?;
    if json {
        answer_json(&json!({ "campaign": {
                "folder": out, "sessions": made, "planned": all.len(), "claims": claims
            } }));
    } else {
        // All options of this call: sessions in virtual and wall-clock time are not to be mixed.
        let new_folder = (!is_named).then(|| format!("--out={}", out.display()));
        let given = std::env::args_os().skip(1).map(|word| word.display().to_string());
        let words = given.chain(new_folder).map(quoted).collect::<Vec<_>>();
        tell(&claims, made, all.len(), &out, &format!("muprime {}", words.join(" ")));
    }
    exit(if whole { DONE } else { FAILED })
}

/// Writes the page of a campaign's folder, and its answers as JSON beside it; gives the answers, the sessions
/// that they rest on, and how many are planned; refused: a folder that holds no campaign, or cannot be
/// written.
pub fn write(folder: &Path) -> miette::Result<(Vec<Claim>, usize, usize)> {
    let (file, made) = studies::campaign::measured(folder)?;
    let (html, claims) = studies::campaign::page(&file, &made)?;
    runs::files::write_plain(&folder.join(PAGE), html)?;
    let answers = serde_json::to_vec_pretty(&claims).into_diagnostic()?;
    runs::files::write_plain(&folder.join("claims.json"), answers)?;
    Ok((claims, made.len(), campaign::sessions(&file).len()))
}

/// The answers for a person, and the command that makes what is missing.
pub fn tell(claims: &[Claim], made: usize, planned: usize, folder: &Path, command: &str) {
    say!("{made} of {planned} sessions are complete");
    if claims.iter().any(|claim| claim.effect.is_some()) {
        say!(
            "the paper's statements; in brackets the change of mu' between the ends of a range, with its 95 % interval:"
        );
    }
    for claim in claims {
        let change = claim.effect.map_or_else(
            || claim.of.clone(),
            |e| format!("{:+.3} [{:+.3}, {:+.3}], {}", e.change, e.ci95[0], e.ci95[1], claim.of),
        );
        say!("{}: {} ({change})", claim.statement, claim.words());
    }
    if made < planned {
        say!("to make the others, repeat the command: {command}");
    }
    say!("page: {}", folder.join(PAGE).display());
}
