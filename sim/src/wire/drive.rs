//! A CANopen drive in profile-velocity mode (CiA 402), as the emulators' stage.
//!
//! Its process data come from the profile; its objects are the few that a drive of this kind must
//! have. It guards itself: when the master's set-points stay away it goes into a fault with an
//! emergency frame, and stays there until it is reset.

use super::device::Device;
use super::{Command, Plant};
use instruments::codec::canopen::{self, DriveState, SdoAnswer, SdoRequest};
use instruments::{CanFrame, FrameId, FrameKind, SetId};
use realtime::Nanos;
use std::collections::HashMap;

/// Time between two heartbeats.
const HEARTBEAT: Nanos = Nanos(50_000_000);
/// Time between two process data frames.
const PROCESS_DATA: Nanos = Nanos(5_000_000);
/// Set-points may stay away this long while the drive is enabled.
const GUARD: Nanos = Nanos(200_000_000);

/// The drive.
pub struct Drive {
    device: Device,
    node: u8,
    operational: bool,
    state: DriveState,
    control: u16,
    mode: u8,
    objects: HashMap<(u16, u8), (u8, u32)>,
    heartbeat_due: Nanos,
    data_due: Nanos,
    heard_at: Nanos,
    booted: bool,
}

impl Drive {
    /// A drive that has just been switched on.
    pub fn new(device: Device, node: u8) -> Self {
        let objects = [
            ((0x1000, 0), (4, 0x0002_0192)),
            ((0x1001, 0), (1, 0)),
            ((0x1018, 1), (4, 0x0000_0001)),
            ((0x603F, 0), (2, 0)),
            ((0x6083, 0), (4, 0)),
            ((0x6084, 0), (4, 0)),
        ];
        Self {
            device,
            node,
            operational: false,
            state: DriveState::Disabled,
            control: 0,
            mode: 0,
            objects: objects.into_iter().collect(),
            heartbeat_due: Nanos(0),
            data_due: Nanos(0),
            heard_at: Nanos(0),
            booted: false,
        }
    }

    /// When it next has something to say.
    pub fn due(&self) -> Option<Nanos> {
        Some(if self.operational { self.heartbeat_due.min(self.data_due) } else { self.heartbeat_due })
    }

    fn process_data(&self) -> Option<(FrameId, u32)> {
        let mut frames = self.device.profile().frames().iter().enumerate();
        frames.find_map(|(i, frame)| match &frame.kind {
            FrameKind::Messages(_, parts) => Some((FrameId(i), parts.first()?.id)),
            _ => None,
        })
    }

    /// What it says by itself: heartbeat, process data, and an emergency where its guard trips.
    pub fn say(&mut self, plant: &mut dyn Plant, now: Nanos) -> Vec<CanFrame> {
        let mut out = Vec::new();
        if !self.booted {
            self.booted = true;
            out.push(canopen::heartbeat(self.node, 0));
        }
        if self.state == DriveState::Enabled && now.since(self.heard_at) > GUARD {
            self.state = DriveState::Fault;
            self.objects.insert((0x603F, 0), (2, 0x8130));
            self.objects.insert((0x1001, 0), (1, 0x11));
            plant.command(&[(Command::Velocity, 0.0)]);
            out.extend(CanFrame::new(0x80 + u32::from(self.node), &[0x30, 0x81, 0x11, 0, 0, 0, 0, 0]));
        }
        if self.heartbeat_due <= now {
            self.heartbeat_due = now.plus(HEARTBEAT);
            out.push(canopen::heartbeat(self.node, if self.operational { 5 } else { 127 }));
        }
        if self.operational && self.data_due <= now {
            self.data_due = now.plus(PROCESS_DATA);
            if let Some((frame, cob)) = self.process_data() {
                let mut bytes = self.device.frame(frame, plant, now);
                bytes[..2].copy_from_slice(&self.status().to_le_bytes());
                out.extend(CanFrame::new(cob + u32::from(self.node), &bytes));
            }
        }
        out
    }

    fn status(&self) -> u16 {
        // Bit 9, remote: the control word is obeyed.
        self.state.word() | 0x0200
    }

    /// Hears one frame; returns its answers.
    pub fn hear(&mut self, frame: &CanFrame, plant: &mut dyn Plant, now: Nanos) -> Vec<CanFrame> {
        if let (0, [command, node]) = (frame.id, frame.data())
            && (*node == 0 || *node == self.node)
        {
            match command {
                0x01 => self.operational = true,
                0x02 | 0x80 => self.operational = false,
                0x81 | 0x82 => {
                    plant.command(&[(Command::Velocity, 0.0)]);
                    *self = Self::new(self.device.clone(), self.node);
                }
                _ => {}
            }
            return Vec::new();
        }
        if let Some(request) = canopen::sdo_request(frame, self.node) {
            return vec![self.serve(request, plant, now)];
        }
        let block =
            self.device.profile().description.write.first().and_then(|block| Some((block.cob?, block.count)));
        if let Some((cob, count)) = block
            && self.operational
            && frame.id == cob + u32::from(self.node)
            && frame.data().len() == 2 * usize::from(count)
        {
            self.heard_at = now;
            let control = u16::from_le_bytes([frame.data()[0], frame.data()[1]]);
            self.obey(control, plant);
            let velocity = self.set_point("velocity", frame.data());
            if self.state == DriveState::Enabled && self.mode == 3 && control & 0x0100 == 0 {
                plant.command(&[(Command::Velocity, velocity)]);
            }
        }
        Vec::new()
    }

    /// A set-point of the process data, in SI units.
    fn set_point(&self, name: &str, data: &[u8]) -> f64 {
        let profile = self.device.profile();
        let si = |set: SetId| Some(profile.decode_set(set, data)? * profile.description.set[set.0].si.factor);
        profile.set(name).and_then(si).unwrap_or(0.0)
    }

    fn obey(&mut self, control: u16, plant: &mut dyn Plant) {
        let edge = control & 0x80 != 0 && self.control & 0x80 == 0;
        self.control = control;
        let before = self.state;
        self.state = self.state.after(control, edge);
        if before == DriveState::Enabled && self.state != DriveState::Enabled || control & 0x0100 != 0 {
            plant.command(&[(Command::Velocity, 0.0)]);
        }
        if edge && self.state != DriveState::Fault {
            self.objects.insert((0x603F, 0), (2, 0));
            self.objects.insert((0x1001, 0), (1, 0));
        }
    }

    fn serve(&mut self, request: SdoRequest, plant: &mut dyn Plant, now: Nanos) -> CanFrame {
        let node = self.node;
        let reply = |index, sub, bytes, answer| canopen::sdo_reply(node, index, sub, bytes, answer);
        match request {
            SdoRequest::Read(index, sub) => {
                let value = match (index, sub) {
                    (0x6040, 0) => Some((2, u32::from(self.control))),
                    (0x6041, 0) => Some((2, u32::from(self.status()))),
                    (0x6060 | 0x6061, 0) => Some((1, u32::from(self.mode))),
                    _ => self.objects.get(&(index, sub)).copied(),
                };
                match value {
                    Some((bytes, value)) => reply(index, sub, bytes, SdoAnswer::Value(value)),
                    None => reply(index, sub, 4, SdoAnswer::Aborted(0x0602_0000)),
                }
            }
            SdoRequest::Write(index, sub, bytes, value) => {
                let mut answer = SdoAnswer::Written;
                match (index, sub) {
                    (0x6040, 0) => {
                        self.heard_at = now;
                        // an object of 16 bits
                        self.obey(value as u16, plant);
                    }
                    // Some drives refuse a change of mode while halted (ros_canopen issue 328).
                    (0x6060, 0) if self.control & 0x0100 != 0 => {
                        return reply(index, sub, 1, SdoAnswer::Aborted(0x0800_0022));
                    }
                    // an object of 8 bits
                    (0x6060, 0) => self.mode = value as u8,
                    (0x6083 | 0x6084, 0) => drop(self.objects.insert((index, sub), (4, value))),
                    _ => answer = SdoAnswer::Aborted(0x0601_0002),
                }
                reply(index, sub, bytes, answer)
            }
        }
    }
}
