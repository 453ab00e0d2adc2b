//! The instruments' part of a setup.

use super::OpenError;
use super::link_error::AddressError;
use super::user_profiles::Source;
use instruments::Profile;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Names of the safety contacts' signals.
pub(crate) const CONTACTS: [&str; 3] = ["emergency_stop", "interlock", "dead_man"];

/// A setup that does not fit the instrument's profile, or an address that leads nowhere.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[allow(missing_docs, reason = "the message of an error says what it is")]
pub enum SetupError {
    #[error("the profile has no signal `{name}`; it has {known}")]
    NoSignal { name: String, known: String },
    #[error("the profile has no set-point `{0}`")]
    NoSetPoint(&'static str),
    #[error("say which signal is `lateral` or `normal`; the profile has {known}")]
    NoAxis { known: String },
    #[error("the gain of axis `{0}` must not be zero, and both numbers must be finite")]
    Gain(&'static str),
    #[error("one signal, `{0}`, cannot be both axes")]
    OneSignal(String),
    #[error("the [[force]] instruments must give each of the axes `lateral` and `normal` once")]
    Axes,
    #[error("`{0}` must be above zero")]
    NotPositive(&'static str),
    #[error("the instrument loads nothing: say the weight that does, as `dead_weight_n`")]
    NoLoad,
    #[error("its set-point `closed` has no `safe` value: it could not be opened at the end")]
    NoSafeValue,
    #[error("`wired`: the profile has no contact `{0}`; contacts: {known}", known = CONTACTS.join(", "))]
    NoContact(String),
    #[error("none of the contacts {} is there and wired", CONTACTS.join(", "))]
    NoContacts,
    #[error("set-points do not go by plain CAN messages; only sensors can be reached so")]
    PlainCan,
    #[error(transparent)]
    Address(#[from] AddressError),
}

/// Which instruments make up the rig.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct InstrumentsSetup {
    /// One instrument with both axes, or two with one each.
    pub force: Vec<InstrumentSetup>,
    /// The ultrasonic drive.
    pub amplifier: InstrumentSetup,
    /// The stage.
    pub stage: InstrumentSetup,
    /// The switch in the amplifier's supply, with readback: the second way to switch off.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub supply_relay: Option<InstrumentSetup>,
    /// Emergency stop, interlock and dead-man device, as digital inputs.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub safety_inputs: Option<InstrumentSetup>,
    /// The chamber around the rig, or a gauge: beside the loop.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub chamber: Option<InstrumentSetup>,
}

impl InstrumentsSetup {
    /// Every instrument.
    pub fn all(&self) -> impl Iterator<Item = &InstrumentSetup> {
        self.force
            .iter()
            .chain([&self.amplifier, &self.stage])
            .chain(&self.supply_relay)
            .chain(&self.safety_inputs)
            .chain(&self.chamber)
    }

    /// Every instrument, to be changed.
    pub fn all_mut(&mut self) -> impl Iterator<Item = &mut InstrumentSetup> {
        let Self { force, amplifier, stage, supply_relay, safety_inputs, chamber } = self;
        let loops = force.iter_mut().chain([amplifier, stage]).chain(supply_relay).chain(safety_inputs);
        loops.chain(chamber)
    }
}

/// One instrument: its profile, and where it is.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct InstrumentSetup {
    /// Id of the profile; in a file, also the path of one.
    pub profile: String,
    /// The profile as it was read, where it does not come with the program. Whoever reads a setup puts it here.
    #[serde(skip)]
    pub source: Option<Arc<Source>>,
    /// Where it is: `host` or `host:port` for TCP and UDP, a path for a serial line (`rtu:PATH` for a Modbus
    /// TCP profile that is reached so), an interface (`can0`) or `slcan:PATH` for CAN.
    pub address: String,
    /// Serial number: certificates must name it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub serial: Option<String>,
    /// Modbus unit, where it is not the profile's.
    pub unit: Option<u8>,
    /// CAN identifier that the instrument's are counted from, or CANopen node, where it is not the profile's.
    pub base: Option<u32>,
    /// Symbols per second of a serial line, where they are not the profile's.
    pub baud: Option<u32>,
    /// Reads per second, where they are not the profile's.
    pub rate_hz: Option<f64>,
    /// Amplifiers whose set-point is a voltage or a current: peak-to-peak metres per unit of it, from the
    /// certificate of the plate.
    pub amplitude_m_per_unit: Option<f64>,
    /// The same for what they measure.
    pub measured_m_per_unit: Option<f64>,
    /// Safety inputs that are wired, by their signals: `emergency_stop`, `interlock`, `dead_man`. Left out:
    /// all that the profile has.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub wired: Option<Vec<String>>,
    /// Stages that load nothing: the weight that does, in N.
    pub dead_weight_n: Option<f64>,
    /// What gives the lateral force. Left out: the signal `lateral`, if the profile has it.
    pub lateral: Option<AxisSetup>,
    /// What gives the normal force. Left out: the signal `normal`, if the profile has it.
    pub normal: Option<AxisSetup>,
}

impl InstrumentSetup {
    /// Whether a contact of the instrument has a device on it.
    pub fn is_wired(&self, contact: &str) -> bool {
        self.wired.as_ref().is_none_or(|wired| wired.iter().any(|name| name == contact))
    }

    /// What the instrument is: the profile that was read with the setup, else the bundled one of that name.
    ///
    /// # Errors
    /// Where there is none, or it does not hold.
    pub fn description(&self) -> Result<Profile, OpenError> {
        self.source.as_ref().map_or_else(|| super::profile(&self.profile), |source| source.profile())
    }

    /// The refusal of its setup.
    pub fn mismatch(&self, problem: impl Into<SetupError>) -> OpenError {
        let (id, address, problem) = (self.profile.clone(), self.address.clone(), problem.into());
        OpenError::Mismatch { id, address, problem }
    }

    /// An instrument of that profile at that address, all else by the profile.
    pub fn new(profile: &str, address: &str) -> Self {
        Self { profile: profile.into(), address: address.into(), ..Self::default() }
    }
}

/// How one axis of the rig comes out of an instrument's signal: `force = gain * signal - offset`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct AxisSetup {
    /// Name of the signal in the profile.
    pub signal: String,
    /// Sign of the mounting and gain of the certificate; -1 turns the axis round.
    #[serde(default = "one")]
    pub gain: f64,
    /// Tare in N, taken off after the gain. It is never found silently at start.
    #[serde(default)]
    pub offset_n: f64,
}

const fn one() -> f64 {
    1.0
}
