//! A profile as a page for people, generated so that it cannot drift from what the drivers do.

use crate::profile::{Frame, FrameKind, Span};
use crate::schema::{Description, Init, Link, LinkKind, ProfileEvidence, Severity, Stamp};
use crate::{Profile, SignalId};
use std::fmt::Write;

/// The page, in Markdown.
pub fn markdown(profile: &Profile) -> String {
    let d = &profile.description;
    let mut page = format!("# {}\n\n", d.profile.id);
    let roles = d.profile.roles.iter().map(spaced).collect::<Vec<_>>().join(", ");
    let (maker, models) = (&d.profile.maker, d.profile.models.join(", "));
    let tried = match d.profile.verified {
        ProfileEvidence::EmulatorOnly => "against emulators and independent programs, never on hardware",
        ProfileEvidence::Bench => "on a bench",
        ProfileEvidence::Published => "on a bench, with published results",
    };
    let _ = writeln!(page, "{maker}: {models}. Roles: {roles}. Tried {tried}.");
    let firmware = d.profile.firmware.as_ref().map(|firmware| format!("Firmware: {firmware}."));
    for text in [Some(d.profile.notes.clone()), firmware].into_iter().flatten().filter(|t| !t.is_empty()) {
        let _ = writeln!(page, "\n{text}");
    }
    let _ = writeln!(page, "\nSource of the facts: {}.\n\nLink: {}.", d.profile.provenance, link(&d.link));
    table(&mut page, "frame | is | bytes | per second", profile.frames().iter().map(|f| frame_row(d, f)));
    table(&mut page, "at connection | for", d.init.iter().map(init_row));
    let signals: Vec<SignalId> = profile.signals().map(|(_, id)| id).collect();
    let heads = "signal | frame | where | unit | resolution | range | noise | what";
    table(&mut page, heads, signals.into_iter().map(|id| signal_row(profile, id)));
    let heads = "set-point | goes as | step | range | safe | echo | what";
    table(&mut page, heads, d.set.iter().map(|set| set_row(d, set)));
    let refused = d.signature.iter().map(|one| {
        vec![format!("not {}", code(one.when.as_ref())), format!("refused at connection: {}", one.text)]
    });
    let faults = d
        .fault
        .iter()
        .map(|one| vec![code(one.when.as_ref()), format!("{}: {}", severity(one.severity), one.text)]);
    table(&mut page, "when | then", refused.chain(faults));
    let _ = writeln!(
        page,
        "\nTime of a sample: {}, {} ms late, \u{b1} {} ms. Test vectors: {}.",
        if d.time.stamp == Stamp::Device { "by the instrument's clock" } else { "when the answer arrived" },
        d.time.latency_ms,
        d.time.jitter_ms,
        d.vector.len()
    );
    page
}

/// A name of the schema in words: 'ForceLateral' is 'force lateral'.
fn spaced(name: &impl std::fmt::Debug) -> String {
    let mut words = String::new();
    for c in format!("{name:?}").chars() {
        if c.is_uppercase() && !words.is_empty() {
            words.push(' ');
        }
        words.extend(c.to_lowercase());
    }
    words
}

/// What follows from a state of the instrument.
fn severity(severity: Severity) -> &'static str {
    match severity {
        Severity::Stop => "the rig stops",
        Severity::Degrade => "the sample counts as degraded",
        Severity::Log => "noted",
    }
}

fn table(page: &mut String, heads: &str, rows: impl Iterator<Item = Vec<String>>) {
    for (at, row) in rows.enumerate() {
        if at == 0 {
            let _ = writeln!(page, "\n| {heads} |\n|{}", "---|".repeat(heads.split('|').count()));
        }
        let _ = writeln!(page, "| {} |", row.join(" | "));
    }
}

/// What is fixed of the link.
fn link(link: &Link) -> String {
    let kind = match link.kind {
        LinkKind::ModbusTcp => "Modbus TCP".into(),
        LinkKind::ModbusRtu => "Modbus RTU".into(),
        LinkKind::Canopen => "CANopen".into(),
        LinkKind::Serial => "serial line".into(),
        kind => format!("{kind:?}").to_uppercase(),
    };
    let mut parts = vec![kind];
    let mut add =
        |name: &str, value: Option<String>| parts.extend(value.map(|value| format!("{name} {value}")));
    add("port", link.port.map(|port| port.to_string()));
    add("to this machine's port", link.local_port.map(|port| port.to_string()));
    add("unit", link.unit.map(|unit| unit.to_string()));
    add("baud", link.baud.map(|baud| baud.to_string()));
    add("format", link.format.clone());
    add("bit rate", link.bitrate.map(|rate| rate.to_string()));
    add("identifiers from", link.base.map(|base| format!("{base:#x}")));
    add("node", link.node.map(|node| node.to_string()));
    add("described by", link.dbc.clone().or_else(|| link.eds.clone()));
    let end = |end: &Option<String>| end.as_ref().map(|end| code(&end.escape_default().to_string()));
    add("lines sent end with", end(&link.tx_terminator));
    add("lines that come end with", end(&link.rx_terminator));
    let alarms: Vec<String> = link.unsolicited.iter().map(|alarm| code(alarm)).collect();
    add("alarms", (!alarms.is_empty()).then(|| alarms.join(" ")));
    add("an answer must be complete within", Some(format!("{} ms", link.response_timeout_ms)));
    parts.join("; ")
}

fn frame_row(d: &Description, frame: &Frame) -> Vec<String> {
    let (is, rate) = match &frame.kind {
        FrameKind::Poll(index) => {
            let poll = &d.poll[*index];
            let span = |s: &Span| match s.count {
                1 => s.address.to_string(),
                _ => format!("{} to {}", s.address, s.end() - 1),
            };
            let spans: Vec<String> = frame.spans.iter().map(span).collect();
            let word = if frame.bytes == 2 { "register" } else { "registers" };
            (format!("{} {word} {}", spaced(&poll.table), spans.join(", ")), poll.rate_hz)
        }
        FrameKind::Stream => {
            let stream = d.stream.as_ref();
            let line = stream.and_then(|stream| stream.line.as_deref()).map(code);
            let check = stream.and_then(|s| s.check).map_or("no check of its own", |check| check.name());
            (line.unwrap_or_else(|| format!("comes by itself; {check}")), stream.map(|stream| stream.rate_hz))
        }
        FrameKind::Messages(index, parts) => {
            let message = &d.message[*index];
            let ids: Vec<String> = parts.iter().map(|part| format!("{:#x}", part.id)).collect();
            let only = message.multiplex.map_or(String::new(), |value| format!(", multiplexor {value}"));
            let how = if message.request.is_some() { "on request" } else { "by themselves" };
            let names = message.replies.join(", ");
            (format!("{names} (base + {}), {how}{only}", ids.join(", ")), Some(message.rate_hz))
        }
        FrameKind::Query(index) => {
            let query = &d.query[*index];
            let answered = |answer: &String| format!(" answered by {}", code(answer));
            let answer = query.answer.as_ref().map_or(String::new(), answered);
            (format!("{}{answer}", code(&query.send)), Some(query.rate_hz))
        }
    };
    vec![frame.name.clone(), is, frame.bytes.to_string(), rate.map_or("once".into(), |rate| rate.to_string())]
}

fn init_row(init: &Init) -> Vec<String> {
    let registers = |(first, values): &(u16, Vec<u16>)| {
        format!("{} registers from {first}: {values:?}", spaced(&init.table))
    };
    let action = None
        .or_else(|| init.send.as_deref().map(code))
        .or_else(|| init.hex.as_ref().map(|hex| format!("bytes {hex}")))
        .or_else(|| init.registers.as_ref().map(registers))
        .or_else(|| init.copy.map(|(from, to, n)| format!("{n} registers from {from} copied to {to}")))
        .or_else(|| init.function.map(|(function, data)| format!("function {function:#04x} with {data}")))
        .or_else(|| init.can.as_ref().map(|(id, data)| format!("message {id:#x}: {data:02x?}")))
        .or_else(|| init.sdo.map(|(index, sub, _, value)| format!("object {index:04X}sub{sub}: {value}")));
    let expect = init.expect.as_ref().map_or(String::new(), |all| {
        format!(", answered by {}", all.iter().map(|start| code(start)).collect::<Vec<_>>().join(" or "))
    });
    vec![format!("{}{expect}", action.unwrap_or_default()), escaped(&init.text)]
}

fn signal_row(profile: &Profile, id: SignalId) -> Vec<String> {
    let signal = &profile.description.signal[id.0];
    let place = None
        .or_else(|| signal.value.as_deref().map(|value| format!("= {}", code(value))))
        .or_else(|| signal.dbc.as_deref().map(code))
        .or_else(|| signal.object.map(|(index, sub)| format!("object {index:04X}sub{sub}")))
        .or_else(|| signal.address.map(|address| format!("register {address}")))
        .or_else(|| signal.register.map(|register| format!("+{register}")))
        .or_else(|| signal.byte.map(|byte| format!("byte {byte}")))
        .unwrap_or_else(|| "line".into());
    let kind = signal.number.map_or(String::new(), |number| format!(" {number:?}").to_lowercase());
    let bits = signal.bits.map_or(String::new(), |(first, width)| format!(", {width} bits from {first}"));
    let step = profile.lsb_si(id, &profile.values());
    let resolution = if signal.scale_expr.is_some() && signal.resolution_si.is_none() {
        "varies".into()
    } else if step.is_finite() {
        // Ten digits: the rest is the rounding of binary factors.
        let step: f64 = format!("{step:.9e}").parse().unwrap_or(step);
        format!("{step} {}", signal.si.unit).trim().to_string()
    } else {
        "resolution unknown".into()
    };
    let unit = signal.unit.as_str();
    vec![
        signal.name.as_ref().clone(),
        profile.frames()[profile.frame_of(id).0].name.clone(),
        format!("{place}{kind}{bits}"),
        unit.into(),
        resolution,
        range(signal.range, unit),
        signal.noise.map_or(String::new(), |noise| format!("{noise} {unit}")),
        escaped(&signal.text),
    ]
}

fn set_row(d: &Description, set: &crate::schema::Set) -> Vec<String> {
    let line = set.send.as_deref().map(|send| match &set.send_zero {
        Some(zero) => format!("{}, zero {}", code(send), code(zero)),
        None => code(send),
    });
    let block = || {
        let named = d.write.iter().find(|write| set.block.as_ref().is_none_or(|b| b == write.name.as_ref()));
        match (set.object, named) {
            (Some((index, sub)), _) => format!("object {index:04X}sub{sub}"),
            (None, Some(write)) => {
                let kind = set.number.map_or(String::new(), |number| format!(" {number:?}").to_lowercase());
                format!("{} register {}{kind}", spaced(&write.table), write.address + set.register)
            }
            (None, None) => String::new(),
        }
    };
    vec![
        set.name.as_ref().clone(),
        line.unwrap_or_else(block),
        format!("{} {}", set.scale, set.unit).trim().to_string(),
        range(set.range, &set.unit),
        set.safe.map_or(String::new(), |safe| safe.to_string()),
        set.echo.clone().unwrap_or_default(),
        escaped(&set.text),
    ]
}

fn range(range: Option<(f64, f64)>, unit: &str) -> String {
    range.map_or(String::new(), |(low, high)| format!("{low} to {high} {unit}").trim().to_string())
}

fn code(text: &str) -> String {
    format!("`{}`", escaped(text))
}

/// A bar ends a table's cell.
fn escaped(text: &str) -> String {
    text.replace('|', "\\|")
}
