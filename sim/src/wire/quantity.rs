//! What of the world a profile may name in its `[emulator]` section.

macro_rules! named {
    ($(#[$doc:meta])* $type:ident { $($(#[$item_doc:meta])* $item:ident = $name:literal,)+ }) => {
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
        pub enum $type { $($(#[$item_doc])* $item,)+ }

        impl $type {
            /// All of them.
            pub const ALL: &[$type] = &[$($type::$item),+];

            /// The name that profiles use.
            pub const fn name(self) -> &'static str {
                match self { $($type::$item => $name,)+ }
            }

            /// The one of that name.
            pub fn from_name(name: &str) -> Option<Self> {
                Self::ALL.iter().copied().find(|one| one.name() == name)
            }
        }
    };
}

named! {
    /// A quantity that an instrument can show.
    Quantity {
        /// Force along the sliding direction as the force sensor gives it, in N.
        LateralForce = "force.lateral_n",
        /// Force into the plate as the force sensor gives it, in N.
        NormalForce = "force.normal_n",
        /// Count of the force sensor's samples.
        ForceSample = "force.sample",
        /// When the force sensor took its sample, by its own clock, in s.
        ForceTime = "force.time_s",
        /// Whether an axis of the force sensor is at its rail.
        ForceSaturated = "force.saturated",
        /// Whether the force sensor reports a fault.
        ForceFault = "force.fault",
        /// Peak-to-peak amplitude of the plate as measured, in m.
        Amplitude = "drive.amplitude_pp_m",
        /// Frequency of the drive as measured, in Hz.
        Frequency = "drive.frequency_hz",
        /// Peak-to-peak set-point in force, in m.
        AmplitudeSetPoint = "drive.set_amplitude_pp_m",
        /// Frequency set-point in force, in Hz.
        FrequencySetPoint = "drive.set_frequency_hz",
        /// Temperature of the plate's mount, in degrees Celsius.
        Temperature = "drive.temperature_c",
        /// Whether the output is on.
        OutputOn = "drive.output_on",
        /// Whether the amplifier's own watchdog has switched it off.
        WatchdogTripped = "drive.watchdog_tripped",
        /// Whether the amplifier reports a fault.
        DriveFault = "drive.fault",
        /// Last heartbeat that the amplifier took.
        Heartbeat = "drive.heartbeat",
        /// Count of the amplifier's states.
        DriveCount = "drive.count",
        /// When the amplifier took its state, in s.
        DriveTime = "drive.time_s",
        /// Position along the stroke, in m.
        Position = "stage.position_m",
        /// Velocity along the stroke as measured, in m/s.
        Velocity = "stage.velocity_m_s",
        /// Velocity set-point in force, in m/s.
        VelocitySetPoint = "stage.set_velocity_m_s",
        /// Normal load set-point in force, in N.
        LoadSetPoint = "stage.set_normal_force_n",
        /// Whether the stage is on a limit of its travel.
        AtLimit = "stage.at_limit",
        /// Whether the stage reports a fault.
        StageFault = "stage.fault",
        /// Count of the stage's states.
        StageCount = "stage.count",
        /// When the stage took its state, in s.
        StageTime = "stage.time_s",
        /// Pressure of the air around the rig, in Pa.
        AmbientPressure = "air.pressure_pa",
        /// Temperature of the air around the rig, in degrees Celsius.
        AirTemperature = "air.temperature_c",
        /// Relative humidity of the air around the rig, in per cent.
        RelativeHumidity = "air.relative_humidity_pct",
        /// Whether the switch in the amplifier's supply is closed, by its mirror contact.
        SupplyClosed = "supply.closed",
        /// Whether the emergency stop's contact is closed: it is not pressed.
        EmergencyStop = "contact.emergency_stop",
        /// Whether the interlock's contact is closed: the guard is shut.
        Interlock = "contact.interlock",
        /// Whether the dead-man device's contact is closed: it is held.
        DeadMan = "contact.dead_man",
        /// The emulated instrument's own time, in s.
        DeviceTime = "device.time_s",
        /// How often the emulated instrument was read.
        DeviceReads = "device.reads",
    }
}

named! {
    /// An absolute set-point that an instrument can take.
    Command {
        /// Peak-to-peak amplitude, in m.
        Amplitude = "drive.amplitude_pp_m",
        /// Frequency, in Hz.
        Frequency = "drive.frequency_hz",
        /// Output on (1) or off (0).
        Enable = "drive.enable",
        /// Heartbeat of the amplifier's watchdog.
        DriveHeartbeat = "drive.heartbeat",
        /// Velocity along the stroke, in m/s.
        Velocity = "stage.velocity_m_s",
        /// Normal load, in N; zero lifts off.
        NormalForce = "stage.normal_force_n",
        /// Heartbeat of the stage's watchdog.
        StageHeartbeat = "stage.heartbeat",
        /// Pressure of the air around the rig, in Pa.
        AmbientPressure = "air.pressure_pa",
        /// Temperature of the air around the rig, in degrees Celsius.
        AirTemperature = "air.temperature_c",
        /// Relative humidity of the air around the rig, in per cent.
        RelativeHumidity = "air.relative_humidity_pct",
        /// The switch in the amplifier's supply closed (1) or open (0).
        CloseSupply = "supply.closed",
        /// Heartbeat of the watchdog of that switch.
        SupplyHeartbeat = "supply.heartbeat",
    }
}

impl Quantity {
    /// Whether it is a counter or a clock, which runs round.
    pub(super) const fn wraps(self) -> bool {
        use Quantity::{DeviceReads, DeviceTime, DriveCount, DriveTime, ForceSample, ForceTime, Heartbeat};
        matches!(
            self,
            ForceSample | ForceTime | DriveCount | DriveTime | DeviceTime | DeviceReads | Heartbeat
        ) || matches!(self, Self::StageCount | Self::StageTime)
    }
}
