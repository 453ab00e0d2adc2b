//! `muprime doctor`: judges this machine truthfully, and talks to the instruments of a setup.

mod peek;

use super::prelude::*;
use realtime::pacing;
use rig::doctor::{Finding, Target};
use rig::emulators::Embedded;
use runs::plan::Plan;
use runs::print::folded;
use runs::setup::Setup;
use serde::Serialize;
use sim::wire::SharedPlant;
use sim::wire::world::WorldPlant;
use sim::world::World;
use std::time::{Duration, Instant};

#[derive(Debug, clap::Args)]
#[command(args_conflicts_with_subcommands = true)]
pub struct Args {
    #[command(subcommand)]
    what: Option<What>,
    /// Setup whose instruments are talked to
    #[arg(long)]
    setup: Option<String>,
    /// Plan that is to run on it: forces, loads and noise are judged by what it asks for
    #[arg(long, requires = "setup")]
    plan: Option<String>,
    /// How long lateness is measured, in s
    #[arg(long, default_value_t = 3.0)]
    seconds: f64,
    /// Only the setup's instruments, not the machine: the exit status then speaks of them alone
    #[arg(long, requires = "setup")]
    instruments_only: bool,
}

#[derive(Debug, clap::Subcommand)]
enum What {
    /// Show the registers, CAN frames or lines of an instrument without a profile; it never writes
    Peek(peek::Args),
}

#[derive(Debug, Serialize)]
struct Judgement {
    findings: Vec<Finding>,
    lateness_us: Option<Lateness>,
    instruments: Vec<Finding>,
}

/// Lateness of a bare 1 kHz sleep, without load and with every core busy, in us.
#[derive(Debug, Serialize)]
struct Lateness {
    idle: [f64; 4],
    loaded: [f64; 4],
    quantiles: [f64; 4],
}

/// Judges; refused: a setup or a plan that cannot be used.
pub fn run(args: Args, json: bool) -> miette::Result<ExitCode> {
    if let Some(What::Peek(args)) = &args.what {
        return peek::run(args, json);
    }
    let setup = args.setup.as_deref().map(super::setup).transpose()?;
    let (findings, lateness_us) =
        if args.instruments_only { (Vec::new(), None) } else { judge(args.seconds) };
    let plan = args.plan.as_deref().map(super::plan).transpose()?;
    let instruments = setup.as_ref().map(|setup| talk(setup, plan.as_ref())).transpose()?.unwrap_or_default();
    let good = findings.iter().chain(&instruments).all(|f| f.good);
    let judgement = Judgement { findings, lateness_us, instruments };
    if json {
        answer_json(&json!({ "good": good, "judgement": judgement }));
    } else {
        for f in judgement.findings.iter().chain(&judgement.instruments) {
            let mark = if f.good { "OK" } else { "FIX" };
            out!("{}", folded(&format!("{mark}  {}: {}", f.subject, f.found), 6));
            if !f.good {
                out!("{}", folded(&format!("      {}", f.advice), 0));
            }
            for channel in &f.channels {
                out!("{}", folded(&format!("      {}", channel.words()), 2));
            }
        }
        if let Some(late) = &judgement.lateness_us {
            for (when, [p50, p99, p999, max]) in [("idle", late.idle), ("loaded", late.loaded)] {
                let line = format!(
                    "      lateness {when}: median {p50:.0} \u{b5}s, 99 % {p99:.0}, 99.9 % {p999:.0}, worst {max:.0} \u{b5}s"
                );
                out!("{}", folded(&line, 2));
            }
        }
    }
    exit(if good { DONE } else { FAILED })
}

fn judge(seconds: f64) -> (Vec<Finding>, Option<Lateness>) {
    let seconds = seconds.clamp(0.1, 60.0);
    let (grants, idle) = measure(seconds, 0);
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let (_, loaded) = measure(seconds, cores);
    let mut findings = machine(&grants);
    findings.push(Finding::new(
        "lateness under load",
        loaded[2] < 500.0,
        format!("99.9 % {:.0} \u{b5}s, worst {:.0} \u{b5}s", loaded[2], loaded[3]),
        "use a PREEMPT_RT kernel, isolate a core (isolcpus, nohz_full), no virtual machine",
    ));
    (findings, Some(Lateness { idle, loaded, quantiles: [0.5, 0.99, 0.999, 1.0] }))
}

/// Lateness quantiles of a 1 kHz sleep in us, with so many busy threads beside it.
fn measure(seconds: f64, busy: usize) -> (pacing::Grants, [f64; 4]) {
    let until = Instant::now() + Duration::from_secs_f64(seconds);
    let loads: Vec<_> = (0..busy)
        .map(|i| {
            std::thread::spawn(move || {
                let mut x = i as f64;
                while Instant::now() < until {
                    for _ in 0..10_000 {
                        x = (x + 1.0).sqrt();
                    }
                }
                std::hint::black_box(x)
            })
        })
        .collect();
    let looping = std::thread::spawn(move || {
        let grants = pacing::ask_for_real_time(80);
        (grants, pacing::lateness_of_sleep(Duration::from_secs_f64(seconds), Duration::from_millis(1)))
    });
    let (grants, mut late) = looping.join().unwrap_or_default();
    for load in loads {
        let _ = load.join();
    }
    late.sort_unstable();
    let at = |q: f64| {
        let i = ((late.len() as f64 * q) as usize).min(late.len().saturating_sub(1));
        late.get(i).map_or(0.0, |ns| *ns as f64 / 1e3)
    };
    (grants, [at(0.5), at(0.99), at(0.999), at(1.0)])
}

fn machine(grants: &pacing::Grants) -> Vec<Finding> {
    let read = |path: &str| std::fs::read_to_string(path).ok().map(|s| s.trim().to_string());
    let fifo = grants.policy == "fifo";
    let throttle = read("/proc/sys/kernel/sched_rt_runtime_us");
    let kernel = read("/proc/sys/kernel/osrelease").unwrap_or_default();
    let preempt_rt = read("/sys/kernel/realtime").as_deref() == Some("1");
    let governor = read("/sys/devices/system/cpu/cpu0/cpufreq/scaling_governor");
    let group = std::path::Path::new("/sys/fs/cgroup/cpu/cpu.rt_runtime_us").exists();
    let slack = read("/proc/self/timerslack_ns");
    let virtual_machine = read("/proc/cpuinfo").is_some_and(|c| c.contains("hypervisor"));
    let class = match &grants.policy_refused {
        None => format!("{} at priority {}, read back", grants.policy, grants.priority),
        Some(why) => format!("{}; SCHED_FIFO was refused: {why}", grants.policy),
    };
    let lock = grants.lock_refused.as_ref().map_or("granted".into(), |why| format!("refused: {why}"));
    let kernel = format!("{kernel}, {}", if preempt_rt { "PREEMPT_RT" } else { "not PREEMPT_RT" });
    let throttled = throttle.as_deref() != Some("0");
    let throttle = throttle.map_or("not readable".into(), |t| format!("sched_rt_runtime_us = {t}"));
    let slack = slack.map_or("not readable".into(), |s| {
        format!("{s} ns for ordinary threads; the loop sets its own to 1 ns")
    });
    let performs = governor.as_deref().is_none_or(|g| g == "performance");
    let governor = governor.unwrap_or_else(|| "no frequency governor is visible".into());
    let host = if virtual_machine { "yes: its host may hold it up for milliseconds" } else { "no" };
    let can = if std::path::Path::new("/proc/net/can").exists() {
        "the kernel has SocketCAN"
    } else {
        "the kernel has no SocketCAN (slcan over a serial port needs none)"
    };
    vec![
        Finding::new(
            "scheduling class",
            fifo,
            class,
            "give the user RLIMIT_RTPRIO (limits.d: '@realtime - rtprio 98') or CAP_SYS_NICE",
        ),
        Finding::new(
            "memory lock",
            grants.memory_locked,
            lock,
            "give the user RLIMIT_MEMLOCK (limits.d: '@realtime - memlock unlimited')",
        ),
        Finding::new(
            "kernel",
            preempt_rt,
            kernel,
            "install a PREEMPT_RT kernel (Debian: linux-image-rt-amd64)",
        ),
        Finding::new(
            "real-time throttling",
            throttled,
            throttle,
            "0 forbids real-time threads; set kernel.sched_rt_runtime_us to 950000",
        ),
        Finding::new(
            "real-time group scheduling",
            !group,
            if group { "in force" } else { "not in force" },
            "outside the root group SCHED_FIFO may be taken away silently: give the group rt_runtime",
        ),
        Finding::new("timer slack", true, slack, ""),
        Finding::new("CPU frequency", performs, governor, "set the governor to 'performance'"),
        Finding::new("virtual machine", !virtual_machine, host, "run a real rig on a machine of its own"),
        Finding::new("CAN", true, can, ""),
    ]
}

/// Looks at every instrument of a setup as a run would, also after one that fails, and says of each what it found.
fn talk(setup: &Setup, plan: Option<&Plan>) -> miette::Result<Vec<Finding>> {
    let mut instruments = setup.instruments();
    let (_claim, _served);
    if setup.file.virtual_rig.is_some() {
        _served = serve(setup, &mut instruments)?;
    } else {
        // Every driver ends with an 'off': that must not reach a rig that another program drives.
        _claim = match rig::rig_lock::RigLock::take(setup) {
            Ok(claim) => claim,
            Err(why) => {
                let found = format!("{why}: {}", why.root_cause());
                return Ok(vec![Finding::new("instruments", false, found, "wait until it ends, or end it")]);
            }
        };
    }
    let look = rig::doctor::look(setup, &instruments);
    let mut findings = rig::doctor::judge(&look, &Target { setup, plan });
    if let Some(v) = &setup.file.vibrometer {
        let settings = drivers::vibrometer::settings(v);
        findings.push(Finding::new(
            format!("vibrometer `{}` at {}", v.profile, v.address),
            settings.is_ok(),
            settings.map_or_else(|problem| problem.to_string(), |settings| settings.to_string()),
            "check line, power and that no other program holds it; Echo must be off",
        ));
    }
    Ok(findings)
}

/// A virtual rig's instruments, served for the look.
fn serve(setup: &Setup, instruments: &mut drivers::InstrumentsSetup) -> miette::Result<Embedded> {
    let config = setup.file.virtual_rig.clone().unwrap_or_default().world();
    let world = World::new(&config, 1).map_err(|e| miette::miette!("{e}"))?;
    let plant = SharedPlant::new(WorldPlant::new(world), Instant::now());
    rig::emulators::embed(instruments, &plant, false).map_err(|problem| miette::miette!("{problem}"))
}
