//! A rig in a process of its own: `muprime virtual-rig` behind Modbus TCP, the setup that reaches it, small
//! plans, and a Modbus master of nothing but bytes that watches the amplifier by the amplifier's own clock.

use crate::muprime;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::path::Path;
use std::process::{Child, Stdio};

/// A small plan: passes of 50 ms after 50 ms at one point of the paper's range, for each of the amplitudes (m, peak-to-peak).
pub fn plan(name: &str, reference_every: u32, amplitudes_pp_m: &[f64]) -> String {
    timed_plan(name, reference_every, amplitudes_pp_m, [0.05, 0.05])
}

/// So many amplitudes of 2 um and some nm: a plan lists no level twice.
pub fn some<const N: usize>() -> [f64; N] {
    std::array::from_fn(|i| 2e-6 + 1e-9 * i as f64)
}

/// The same with s to settle and s to measure, repeated up to a thousand times in turn.
pub fn timed_plan(name: &str, reference_every: u32, amplitudes_pp_m: &[f64], times_s: [f64; 2]) -> String {
    format!(
        "name = \"{name}\"\nseed = 3\nreference_every = {reference_every}\n[pass]\nsettle_s = {}\nmeasure_s = {}\n\
         [base]\namplitude_pp_m = 2e-6\nfrequency_hz = 27500\nspeed_m_s = 0.02\nnormal_force_n = 0.25\n\
         [[series]]\namplitude_pp_m = {amplitudes_pp_m:?}\n",
        times_s[0], times_s[1]
    )
}

/// A setup whose three instruments are served at an address, at 250 Hz. Nothing real is driven: rate and
/// limits allow for a machine that takes a CPU away for tens of ms at a time.
pub fn setup(name: &str, address: SocketAddr) -> String {
    let instrument = |head: &str, id: &str| format!("{head}\nprofile = \"{id}\"\naddress = \"{address}\"\n");
    format!(
        "name = \"{name}\"\n[loop]\nrate_hz = 250\n{}{}{}\n[finger]\ntip = \"artificial-silicone\"\n[noise]\npass_relative_sd = 0.015\n\
         force_sd_n = 0.0008\n[limits]\nlate_cycles_max = 100\nlate_in_a_row_max = 45\nlink_stall_s = 0.045\n",
        instrument("[[force]]", "muprime-force2"),
        instrument("[amplifier]", "muprime-amplifier"),
        instrument("[stage]", "muprime-stage"),
    )
}

/// A running `muprime virtual-rig`; it ends with this value.
pub struct ServedRig {
    /// The process.
    pub process: Child,
    /// Where its Modbus TCP server listens.
    pub address: SocketAddr,
}

impl ServedRig {
    /// Starts an ideal rig on a free port of loopback, with a defects file if one is given.
    pub fn start(seed: u64, defects: Option<&Path>) -> Self {
        Self::of("virtual-ideal", seed, defects)
    }

    /// The same with the instruments of a bundled setup.
    pub fn of(setup: &str, seed: u64, defects: Option<&Path>) -> Self {
        let mut command = muprime();
        command.args(["--json", "virtual-rig", "--setup", setup, "--modbus-tcp", "127.0.0.1:0"]);
        command.args(["--seed", &seed.to_string()]);
        if let Some(path) = defects {
            command.arg("--defects").arg(path);
        }
        let mut process = command.stdout(Stdio::piped()).stderr(Stdio::null()).spawn().expect("muprime runs");
        let mut said = String::new();
        BufReader::new(process.stdout.take().expect("piped")).read_line(&mut said).expect("it says where");
        let said: serde_json::Value = serde_json::from_str(&said).expect("one JSON document");
        let address = said["modbus_tcp"].as_str().expect("it listens").parse().expect("an address");
        ServedRig { process, address }
    }
}

impl Drop for ServedRig {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

/// What the amplifier says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AmplifierSaid {
    /// Its clock in us.
    pub time_us: u32,
    /// Its output is on.
    pub on: bool,
    /// The last heartbeat that it got.
    pub heartbeat: u16,
}

/// A Modbus master of nothing but bytes: function 3 on unit 2.
pub struct AmplifierWatch(TcpStream);

impl AmplifierWatch {
    /// Connects to a served rig.
    pub fn connect(address: SocketAddr) -> Self {
        let stream = TcpStream::connect(address).expect("the rig listens");
        stream.set_nodelay(true).expect("a TCP option");
        AmplifierWatch(stream)
    }

    /// Reads the state registers.
    pub fn read(&mut self) -> AmplifierSaid {
        self.0.write_all(&[0, 1, 0, 0, 0, 6, 2, 3, 0, 0, 0, 20]).expect("the rig listens");
        let mut answer = [0u8; 9 + 40];
        self.0.read_exact(&mut answer).expect("the rig answers");
        let register = |n: usize| u16::from_be_bytes([answer[9 + 2 * n], answer[10 + 2 * n]]);
        let time_us = u32::from(register(4)) << 16 | u32::from(register(5));
        AmplifierSaid { time_us, on: register(15) & 1 != 0, heartbeat: register(16) }
    }
}

/// Resident memory of a process in bytes, from `/proc`; `None` once it has ended.
pub fn resident_bytes(pid: u32) -> Option<u64> {
    let text = std::fs::read_to_string(format!("/proc/{pid}/status")).ok()?;
    let line = text.lines().find(|l| l.starts_with("VmRSS:"))?;
    line.split_whitespace().nth(1)?.parse::<u64>().ok().map(|kib| kib * 1024)
}
