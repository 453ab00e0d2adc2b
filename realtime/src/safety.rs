//! Safety: limits, the state machine, and the only constructors of commands that move or drive anything.

use crate::ports::Nanos;
use models::quantity::PeakToPeak;

/// An absolute set-point for the amplifier. Only this module can make one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DriveCommand {
    amplitude: PeakToPeak,
    frequency_hz: f64,
    enable: bool,
    sequence: u32,
    expires_at: Nanos,
}

impl DriveCommand {
    /// Peak-to-peak amplitude; zero when not enabled.
    pub const fn amplitude(&self) -> PeakToPeak {
        self.amplitude
    }

    /// Drive frequency in Hz.
    pub const fn frequency_hz(&self) -> f64 {
        self.frequency_hz
    }

    /// Whether the output is to be on.
    pub const fn enable(&self) -> bool {
        self.enable
    }

    /// Counts commands; doubles as the heartbeat that the amplifier's watchdog watches.
    pub const fn sequence(&self) -> u32 {
        self.sequence
    }

    /// When the command must no longer be sent.
    pub const fn expires_at(&self) -> Nanos {
        self.expires_at
    }

    /// The command that every state but one gives: output off, amplitude zero.
    pub const fn off(sequence: u32, expires_at: Nanos) -> Self {
        DriveCommand { amplitude: PeakToPeak::ZERO, frequency_hz: 0.0, enable: false, sequence, expires_at }
    }
}

/// Absolute set-points for the stage. Only this module can make one that moves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StageCommand {
    velocity_m_s: f64,
    normal_force_n: f64,
    sequence: u32,
    expires_at: Nanos,
}

impl StageCommand {
    /// Velocity along the stroke in m/s, signed.
    pub const fn velocity_m_s(&self) -> f64 {
        self.velocity_m_s
    }

    /// Normal load set-point in N; zero lifts the finger off.
    pub const fn normal_force_n(&self) -> f64 {
        self.normal_force_n
    }

    /// Counts commands.
    pub const fn sequence(&self) -> u32 {
        self.sequence
    }

    /// When the command must no longer be sent.
    pub const fn expires_at(&self) -> Nanos {
        self.expires_at
    }

    /// Stand still, lifted off.
    pub const fn stop(sequence: u32, expires_at: Nanos) -> Self {
        StageCommand { velocity_m_s: 0.0, normal_force_n: 0.0, sequence, expires_at }
    }
}
