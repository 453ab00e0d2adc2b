//! What a column of a foreign table can stand for, and which headers usually say so.

use instruments::Dimension;

/// How a cell is read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ColumnKind {
    /// A number with a unit.
    Number(Dimension),
    /// A whole number.
    Count,
    /// 1 or -1, `forward` or `backward`.
    Way,
    /// Text.
    Text,
}

/// One thing that a column can stand for.
#[derive(Debug)]
pub struct ColumnTarget {
    /// Which one it is.
    pub id: Id,
    /// Name in `--map` and `--set`.
    pub name: &'static str,
    /// Column of the point table that it gives.
    pub column: &'static str,
    /// How a cell is read.
    pub kind: ColumnKind,
    /// What it is.
    pub words: &'static str,
    /// Headers that usually mean it: small letters and digits, the unit taken off.
    pub headers: &'static [&'static str],
}

macro_rules! targets {
    ($($id:ident $name:literal $column:literal $kind:expr, $words:literal, [$($header:literal)*];)*) => {
        /// The places of the targets in [`TARGETS`].
        #[allow(clippy::upper_case_acronyms)]
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum Id { $(#[doc = $words] $id),* }
        /// How many targets there are.
        pub const COUNT: usize = [$($name),*].len();
        /// Every target, in the order of presentation.
        pub static TARGETS: &[ColumnTarget] =
            &[$(ColumnTarget { id: Id::$id, name: $name, column: $column, kind: $kind, words: $words, headers: &[$($header),*] }),*];
    };
}

use ColumnKind::{Count, Number, Text, Way};
use Dimension as D;

targets! {
    Point "point" "point" Count, "number of the pass", ["point" "no" "nr" "number" "index"];
    Time "time" "time_s" Number(D::Time), "start of the pass", ["t" "time" "zeit" "timestamp" "elapsed" "elapsedtime" "testtime" "clock" "uhrzeit" "xvalue"];
    AmplitudePp "amplitude_pp" "amplitude_pp_m" Number(D::Length), "vibration amplitude, peak to peak", ["w" "wpp" "amp" "ampl" "amplitude" "amppp" "amplitudepp" "amplitudepeaktopeak" "amplitudep2p" "vibrationamplitude" "schwingungsamplitude"];
    AmplitudePeak "amplitude_peak" "amplitude_pp_m" Number(D::Length), "vibration amplitude, zero to peak: half of what the table holds", ["amplitudepeak" "amppeak" "amplitude0p" "amp0p" "amplitudezeropeak"];
    AmplitudeRms "amplitude_rms" "amplitude_pp_m" Number(D::Length), "vibration amplitude, root mean square of a sine", ["amplituderms" "amprms"];
    Frequency "frequency" "frequency_hz" Number(D::Frequency), "vibration frequency", ["f" "freq" "frequency" "frequenz" "vibrationfrequency"];
    Speed "speed" "speed_m_s" Number(D::Speed), "sliding speed, a magnitude", ["speed" "slidingspeed" "geschwindigkeit" "u" "v" "vel" "velocity" "slidingvelocity" "vx"];
    Velocity "velocity" "speed_m_s" Number(D::Speed), "sliding velocity: its sign is the direction", [];
    Direction "direction" "direction" Way, "direction of sliding", ["direction" "dir" "richtung" "way" "sense"];
    Position "position" "position_m" Number(D::Length), "mean position along the plate", ["x" "pos" "position" "displacement" "disp" "stroke" "weg" "distance"];
    NormalForce "normal_force" "normal_force_n" Number(D::Force), "mean normal force, positive in compression", ["fn" "fz" "normalforce" "normal" "load" "normalload" "appliedload" "normalkraft" "anpresskraft" "forcez"];
    LateralForce "lateral_force" "lateral_force_n" Number(D::Force), "mean lateral force, signed in the sensor's frame", ["ft" "fl" "fx" "fy" "lateralforce" "lateral" "tangentialforce" "tangential" "shearforce" "querkraft" "forcex" "forcey" "flat"];
    FrictionForce "friction_force" "lateral_force_n" Number(D::Force), "friction force against the sliding, a magnitude", ["ff" "friction" "frictionforce" "reibkraft" "fr" "frictionalforce"];
    FrictionCoefficient "friction_coefficient" "lateral_force_n" Number(D::Ratio), "friction force over normal force, a magnitude", ["mu" "cof" "frictioncoefficient" "coefficientoffriction" "coefficient" "frictioncoeff" "reibzahl" "reibwert"];
    NormalForceSd "normal_force_sd" "normal_force_sd_n" Number(D::Force), "standard deviation of the normal force within the pass", ["fnsd" "fnstd" "normalforcesd" "normalforcestd"];
    LateralForceSd "lateral_force_sd" "lateral_force_sd_n" Number(D::Force), "standard deviation of the lateral force within the pass", ["ftsd" "ftstd" "lateralforcesd" "lateralforcestd"];
    Samples "samples" "samples" Count, "samples behind the means", ["samples" "nsamples" "n"];
    Pressure "ambient_pressure" "ambient_pressure_pa" Number(D::Pressure), "ambient pressure", ["ambientpressure" "airpressure" "barometricpressure" "luftdruck"];
    Temperature "temperature" "temperature_c" Number(D::Temperature), "temperature", ["temperature" "temp" "temperatur"];
    Humidity "relative_humidity" "relative_humidity_pct" Number(D::Percentage), "relative humidity", ["relativehumidity" "humidity" "rh" "feuchte"];
    PhaseShift "phase_shift" "phase_shift_deg" Number(D::Angle), "contact phase shift", ["phaseshift" "phase"];
    Replicate "replicate" "replicate" Count, "number of the repeat of one condition", ["replicate" "rep" "repeat" "repetition"];
    Run "run" "run" Text, "name of the run", ["run" "test" "testid" "sample" "sampleid" "specimen" "experiment"];
    Session "session" "session" Count, "number of the sitting", ["session"];
}

impl Id {
    /// What stands there.
    pub fn target(self) -> &'static ColumnTarget {
        &TARGETS[self as usize]
    }
}

impl ColumnTarget {
    /// The target of that name, or of that column of the point table.
    pub fn named(name: &str) -> Option<&'static ColumnTarget> {
        let exact = TARGETS.iter().find(|t| t.name == name);
        exact.or_else(|| TARGETS.iter().find(|t| t.column == name))
    }

    /// The target that a header usually means.
    pub fn headed(header: &str) -> Option<&'static ColumnTarget> {
        let plain = plain(header);
        let is = |name: &str| self::plain(name) == plain;
        TARGETS.iter().find(|t| is(t.name) || is(t.column) || t.headers.contains(&plain.as_str()))
    }

    /// What its numbers measure.
    pub const fn dimension(&self) -> Option<Dimension> {
        match self.kind {
            Number(dimension) => Some(dimension),
            _ => None,
        }
    }
}

/// A header without case, blanks and marks. Letters that are not Latin stay: what they say is not known, so
/// that no name may be found in the rest.
pub fn plain(header: &str) -> String {
    let small = header.to_lowercase().replace(['µ', 'μ'], "mu");
    small.chars().filter(|c| c.is_alphanumeric()).collect()
}
