//! Compiles and drives `ridge_twin.c`, the kernel's twin in C: one process a variant, spoken to by its standard streams.
//! Included by the benchmarks and by `tests/ridge_twin.rs`; not every user needs every function.
#![allow(dead_code, reason = "included by several programs")]

use muprime_models::ridge::{Material, Mesh, Strain};
use std::io::{BufReader, BufWriter, Read, Write};
use std::path::PathBuf;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

/// How the twin is compiled.
#[derive(Clone, Copy, Debug)]
pub struct Variant {
    /// Single precision.
    pub single: bool,
    /// Cases side by side.
    pub lanes: usize,
    /// As in [`muprime_models::ridge::Body::new`].
    pub strain: Strain,
    /// Vectors of 512 bits; otherwise no AVX-512 at all, 256 bits.
    pub avx512: bool,
}

impl Variant {
    /// Double precision, one case along its rows.
    pub fn plain(strain: Strain, avx512: bool) -> Variant {
        Variant { single: false, lanes: 1, strain, avx512 }
    }

    /// Compiles the twin with `cc -O3 -march=native`.
    fn compile(self) -> PathBuf {
        let objective = u8::from(self.strain == Strain::Objective);
        let real = if self.single { "float" } else { "double" };
        let width: &[&str] = if self.avx512 {
            &["-mprefer-vector-width=512"]
        } else {
            &["-mno-avx512f", "-mprefer-vector-width=256"]
        };
        let name = format!(
            "twin-{real}-{}-{objective}-{}-{}",
            self.lanes,
            u8::from(self.avx512),
            std::process::id()
        );
        let program = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name);
        let status = Command::new("cc")
            .args(["-O3", "-march=native", "-ffp-contract=fast", "-fno-math-errno", "-fno-trapping-math"])
            .args(width)
            .args([
                format!("-DREAL={real}"),
                format!("-DLANES={}", self.lanes),
                format!("-DOBJECTIVE={objective}"),
            ])
            .arg(concat!(env!("CARGO_MANIFEST_DIR"), "/benches/peers/ridge_twin.c"))
            .arg("-o")
            .arg(&program)
            .arg("-lm")
            .status()
            .expect("a C compiler named cc");
        assert!(status.success(), "ridge_twin.c does not compile");
        program
    }
}

/// What is the same in all lanes.
pub struct Frame<'a> {
    /// The mesh; its materials are those of the lanes.
    pub mesh: &'a Mesh,
    /// Time step in s.
    pub dt: f64,
    /// Mass damping in 1/s.
    pub damping: f64,
    /// The node row that carries the dead loads, and each node's share of them.
    pub base: (usize, Vec<f64>),
    /// Weight of each surface node under the vibrometer's spot.
    pub spot: Vec<f64>,
}

/// What differs from lane to lane.
#[derive(Clone)]
pub struct Lane {
    /// Amplitude of the plate's sine, m.
    pub sine_m: f64,
    /// Its frequency, Hz.
    pub frequency_hz: f64,
    /// Speed of the plate, m/s.
    pub speed_m_s: f64,
    /// Coefficient of friction.
    pub mu0: f64,
    /// Spring of each surface node, N/m per metre of depth.
    pub penalty: Vec<f64>,
    /// Material of each element row.
    pub material: Vec<Material>,
}

/// Force of the plate in a run, mean over its steps, N per metre of depth.
#[derive(Clone, Copy, Debug, Default)]
pub struct Force {
    pub normal: f64,
    pub lateral: f64,
}

/// The state of lane 0: x, y, vx, vy of the nodes (closing nodes too), then sxx, syy, sxy of the elements.
pub struct State {
    pub nodes: [Vec<f64>; 4],
    pub stress: [Vec<f64>; 3],
}

/// A running twin.
pub struct Twin {
    child: Child,
    to: BufWriter<ChildStdin>,
    from: BufReader<ChildStdout>,
    program: PathBuf,
    lanes: usize,
    nodes: usize,
    elements: usize,
}

impl Twin {
    /// Compiles and starts one. `lanes` holds as many as the variant has.
    pub fn start(variant: Variant, frame: &Frame<'_>, lanes: &[Lane]) -> Twin {
        assert_eq!(lanes.len(), variant.lanes);
        let program = variant.compile();
        let mut child = Command::new(&program)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .expect("the twin starts");
        let to = BufWriter::new(child.stdin.take().expect("piped"));
        let from = BufReader::new(child.stdout.take().expect("piped"));
        let mesh = frame.mesh;
        let mut twin = Twin {
            child,
            to,
            from,
            program,
            lanes: lanes.len(),
            nodes: (mesh.nx + 1) * (mesh.ny + 1),
            elements: mesh.elements(),
        };
        twin.whole(mesh.nx as i64);
        twin.whole(mesh.ny as i64);
        twin.numbers(&[frame.dt, frame.damping, mesh.width_m()]);
        twin.whole(frame.base.0 as i64);
        twin.numbers(&frame.base.1);
        twin.numbers(&frame.spot);
        for j in 0..=mesh.ny {
            for i in 0..=mesh.nx {
                let n = j * mesh.stride() + i;
                twin.numbers(&[mesh.x_m[n], mesh.y_m[n]]);
            }
        }
        for lane in lanes {
            twin.numbers(&[lane.sine_m, lane.frequency_hz, lane.speed_m_s, lane.mu0]);
            twin.numbers(&lane.penalty);
            for m in &lane.material {
                twin.numbers(&[m.young_modulus_pa, m.poisson_ratio, m.density_kg_m3]);
            }
        }
        twin.flush();
        let mut ready = [0];
        twin.from.read_exact(&mut ready).expect("the twin reads its case");
        twin
    }

    /// Runs `steps`, the first with the plate at step number `first`; CPU seconds and the force on each lane.
    pub fn run(&mut self, steps: usize, first: usize) -> (f64, Vec<Force>) {
        self.letter(b'r');
        self.whole(steps as i64);
        self.whole(first as i64);
        self.flush();
        let seconds = self.read();
        let forces = (0..self.lanes).map(|_| Force { normal: self.read(), lateral: self.read() }).collect();
        (seconds, forces)
    }

    /// Dead loads at the base row, N per metre of depth: towards the plate, and against its motion.
    pub fn load(&mut self, normal: f64, lateral: f64) {
        self.letter(b'l');
        self.numbers(&[normal, lateral]);
    }

    /// Another amplitude and speed of the plate, on every lane.
    pub fn plate(&mut self, sine_m: f64, speed_m_s: f64) {
        self.letter(b'a');
        self.numbers(&[sine_m, speed_m_s]);
    }

    /// Mean vertical velocity of the spot in m/s, lane 0.
    pub fn spot_velocity(&mut self) -> f64 {
        self.letter(b'v');
        self.flush();
        let all: Vec<f64> = (0..self.lanes).map(|_| self.read()).collect();
        all[0]
    }

    /// The state of a lane.
    pub fn state(&mut self, lane: usize) -> State {
        self.letter(b's');
        self.flush();
        let (nodes, elements, lanes) = (self.nodes, self.elements, self.lanes);
        let mut field = |n: usize| -> Vec<f64> {
            let all: Vec<f64> = (0..n * lanes).map(|_| self.read()).collect();
            all.into_iter().skip(lane).step_by(lanes).collect()
        };
        State {
            nodes: [field(nodes), field(nodes), field(nodes), field(nodes)],
            stress: [field(elements), field(elements), field(elements)],
        }
    }

    fn letter(&mut self, letter: u8) {
        self.to.write_all(&[letter]).expect("the twin listens");
    }

    fn whole(&mut self, n: i64) {
        self.to.write_all(&n.to_ne_bytes()).expect("the twin listens");
    }

    fn numbers(&mut self, values: &[f64]) {
        for v in values {
            self.to.write_all(&v.to_ne_bytes()).expect("the twin listens");
        }
    }

    fn flush(&mut self) {
        self.to.flush().expect("the twin listens");
    }

    fn read(&mut self) -> f64 {
        let mut bytes = [0; 8];
        self.from.read_exact(&mut bytes).expect("the twin answers");
        f64::from_ne_bytes(bytes)
    }
}

impl Drop for Twin {
    fn drop(&mut self) {
        let _ = self.to.write_all(b"q").and_then(|()| self.to.flush());
        let _ = self.child.wait();
        let _ = std::fs::remove_file(&self.program);
    }
}
