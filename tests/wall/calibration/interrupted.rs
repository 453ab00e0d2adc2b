//! Guided weighing over a link that goes down, and over a program that ends in the middle: nothing weighed is lost.

use sim::wire::SharedPlant;
use sim::wire::device::Device;
use sim::wire::modbus_tcp::ModbusTcpServer;
use sim::wire::world::{Hands, WorldPlant};
use sim::world::{World, WorldConfig};
use std::collections::BTreeMap;
use std::io::{BufRead, BufReader, Write as _};
use std::net::SocketAddr;
use std::path::Path;
use std::process::{Child, ChildStdin, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

/// Lines of a stream as they come.
fn lines(stream: impl std::io::Read + Send + 'static) -> Receiver<String> {
    let (to, from) = channel();
    std::thread::spawn(move || {
        BufReader::new(stream).lines().map_while(Result::ok).try_for_each(|line| to.send(line))
    });
    from
}

/// The virtual rig's instruments at one address, with an operator's hands.
struct Bench {
    plant: SharedPlant,
    hands: Hands,
    address: SocketAddr,
    server: Option<ModbusTcpServer>,
}

impl Bench {
    fn new() -> Self {
        let (world, hands) = WorldPlant::at_hand(World::new(&WorldConfig::ideal(), 5).unwrap());
        let plant = SharedPlant::new(world, Instant::now());
        let mut bench = Bench { plant, hands, address: "127.0.0.1:0".parse().unwrap(), server: None };
        bench.plug_in();
        bench
    }

    fn plug_in(&mut self) {
        let devices: BTreeMap<u8, Device> =
            [(1, "muprime-force2"), (2, "muprime-amplifier"), (3, "muprime-stage")]
                .map(|(unit, id)| (unit, Device::new(drivers::profile(id).unwrap()).unwrap()))
                .into();
        let server = ModbusTcpServer::start(self.address, devices, self.plant.clone()).unwrap();
        self.address = server.address();
        self.server = Some(server);
    }

    /// Ends the server with its connections, as a pulled cable does.
    fn pull(&mut self) {
        self.server = None;
    }

    fn setup(&self, folder: &Path) {
        let text = std::fs::read_to_string(tests::file("runs/setups/virtual-ideal.toml")).unwrap();
        let text =
            text.replace("127.0.0.1:0", &self.address.to_string()).replace("[virtual]\nideal = true\n", "");
        std::fs::write(folder.join("rig.toml"), text).unwrap();
    }
}

/// The guided program.
struct Guided {
    child: Child,
    operator: ChildStdin,
    said: Receiver<String>,
}

impl Guided {
    fn start(folder: &Path, more: &[&str]) -> Self {
        let mut child = tests::muprime()
            .current_dir(folder)
            .args([
                "calibrate",
                "force",
                "--average-s",
                "0.3",
                "--operator",
                "O",
                "--serial",
                "W-1",
                "--json",
            ])
            .args(["--out", "weighed.toml"])
            .args(more)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let said = lines(child.stderr.take().unwrap());
        Guided { operator: child.stdin.take().unwrap(), child, said }
    }

    fn type_in(&mut self, line: &str) {
        writeln!(self.operator, "{line}").unwrap();
    }

    /// Waits for a line that holds this.
    fn hear(&self, what: &str) -> String {
        let mut before = Vec::new();
        loop {
            match self.said.recv_timeout(Duration::from_secs(60)) {
                Ok(line) if line.contains(what) => return line,
                Ok(line) => before.push(line),
                Err(e) => panic!("never heard `{what}` ({e}) after\n{}", before.join("\n")),
            }
        }
    }
}

#[test]
fn a_link_that_goes_down_is_waited_for_and_nothing_weighed_is_lost() {
    let folder = tempfile::tempdir().unwrap();
    let mut bench = Bench::new();
    bench.setup(folder.path());
    let mut guided = Guided::start(folder.path(), &["--setup", "rig.toml"]);
    guided.type_in("zero");
    guided.hear(" counts");
    bench.hands.hang(0.4903, 0.0);
    std::thread::sleep(Duration::from_millis(300));
    guided.type_in("lateral 0.05 up");
    guided.hear(" counts");
    // The cable comes out in the middle of a reading, and goes in again a second later.
    bench.hands.hang(0.9807, 0.0);
    guided.type_in("lateral 0.1 up");
    std::thread::sleep(Duration::from_millis(100));
    bench.pull();
    let told = guided.hear("waiting up to 60 s");
    assert!(told.contains("nothing that was weighed is lost"), "{told}");
    std::thread::sleep(Duration::from_millis(1000));
    bench.plug_in();
    guided.hear("the link is back");
    let read = guided.hear(" counts");
    assert!(read.contains("means of"), "{read}");
    // All three readings stand on the disk already, the third with the weight that hung then: 0.1 mN a count.
    let part = folder.path().join("weighed.csv.part");
    let text = std::fs::read_to_string(&part).unwrap();
    let rows: Vec<Vec<&str>> = text.lines().skip(2).map(|l| l.split(',').collect()).collect();
    assert_eq!(rows.len(), 3, "{text}");
    let count = |row: usize| rows[row][3].parse::<f64>().unwrap();
    let (half, whole) = (count(1) - count(0), count(2) - count(0));
    assert!((whole / half - 2.0).abs() < 0.02, "{text}");
    let times: Vec<f64> = rows.iter().map(|r| r[0].parse().unwrap()).collect();
    assert!(times[2] - times[1] > 1.0, "the reading is of after the break: {times:?}");
    // The program dies; the next one takes the three readings up.
    guided.child.kill().unwrap();
    guided.child.wait().unwrap();
    let mut again = Guided::start(folder.path(), &["--setup", "rig.toml"]);
    again.hear("resumes with 3 readings of an earlier session");
    again.type_in("zero");
    again.hear(" counts");
    again.type_in("undo");
    let forgotten = again.hear("forgotten");
    assert!(forgotten.contains("zero"), "{forgotten}");
    drop(again.operator);
    assert_eq!(again.child.wait().unwrap().code(), Some(2), "the input ended");
    assert_eq!(std::fs::read_to_string(&part).unwrap().lines().count(), 2 + 3);
    assert!(!folder.path().join("weighed.toml").exists());
}

#[test]
fn a_link_that_stays_down_ends_the_reading_not_the_series() {
    let folder = tempfile::tempdir().unwrap();
    let mut bench = Bench::new();
    bench.setup(folder.path());
    let mut guided = Guided::start(folder.path(), &["--setup", "rig.toml", "--reconnect-s", "1"]);
    guided.type_in("zero");
    guided.hear(" counts");
    bench.pull();
    guided.type_in("zero");
    guided.hear("did not come back within 1 s");
    bench.plug_in();
    // The operator tries again, as told.
    let mut tries = 0;
    loop {
        guided.type_in("zero");
        let line = loop {
            let line = guided.hear(" ");
            if line.contains(" counts") || line.contains("no reading") {
                break line;
            }
        };
        if line.contains("means of") {
            break;
        }
        tries += 1;
        assert!(tries < 20, "{line}");
    }
    guided.child.kill().unwrap();
    guided.child.wait().unwrap();
    let text = std::fs::read_to_string(folder.path().join("weighed.csv.part")).unwrap();
    assert_eq!(text.lines().count(), 2 + 2, "{text}");
}
