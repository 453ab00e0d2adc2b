//! `muprime doctor peek ADDRESS`: what an instrument sends, before it has a profile.

use super::super::prelude::*;
use clap::ValueEnum;
use drivers::peek::{self, PeekAddress, Speed};
use instruments::schema::Table;
use std::time::Duration;

#[derive(Debug, clap::Args)]
pub struct Args {
    /// rtu:PATH or tcp:HOST:PORT with registers, can0 or slcan:PATH for frames, PATH or
    /// tcp:HOST:PORT for lines
    address: String,
    /// Registers, the last one included, as in 100..103; without them lines or frames are shown
    #[arg(value_parser = range)]
    registers: Option<(u16, u16)>,
    /// Modbus unit
    #[arg(long, default_value_t = 1)]
    unit: u8,
    /// Modbus table
    #[arg(long, value_enum, default_value_t = Kind::Holding)]
    table: Kind,
    /// Speed of a serial line
    #[arg(long, default_value_t = 19_200)]
    baud: u32,
    /// Data bits, parity and stop bits of a serial line
    #[arg(long, default_value = "8N1")]
    format: String,
    /// Bit rate of a CAN bus behind a serial adapter
    #[arg(long, default_value_t = 500_000)]
    bitrate: u32,
    /// How long to listen to lines or frames, in s (at most 60)
    #[arg(long, default_value = "2", value_parser = duration)]
    seconds: Duration,
}

/// Tables of Modbus.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum Kind {
    /// Holding registers (function 3)
    Holding,
    /// Input registers (function 4)
    Input,
    /// Coils (function 1)
    Coil,
    /// Discrete inputs (function 2)
    Discrete,
}

/// How long to listen.
fn duration(text: &str) -> Result<Duration, String> {
    let seconds = text.parse().ok().filter(|s| (0.1..=60.0).contains(s));
    seconds.map(Duration::from_secs_f64).ok_or_else(|| "give 0.1 to 60 seconds".into())
}

/// First register and count.
fn range(text: &str) -> Result<(u16, u16), String> {
    let (first, last) = text.split_once("..").unwrap_or((text, text));
    let number =
        |text: &str| text.parse::<u16>().map_err(|_| "write 100 or 100..103, from 0 to 65535".to_string());
    let (first, last) = (number(first)?, number(last)?);
    let count = last.checked_sub(first).and_then(|n| n.checked_add(1)).filter(|n| *n <= peek::MOST_REGISTERS);
    let count =
        count.ok_or_else(|| format!("give 1 to {} registers in rising order", peek::MOST_REGISTERS))?;
    Ok((first, count))
}

/// Shows what is there; fails where nobody answers, or the answer is no good.
pub fn run(args: &Args, json: bool) -> miette::Result<ExitCode> {
    let place = PeekAddress::of(&args.address);
    let speed = Speed { baud: args.baud, format: args.format.clone() };
    let long = args.seconds;
    let failed = |why: peek::PeekError| miette::miette!("{}: {why}", args.address);
    if let Some((first, count)) = args.registers {
        let table = match args.table {
            Kind::Holding => Table::Holding,
            Kind::Input => Table::Input,
            Kind::Coil => Table::Coil,
            Kind::Discrete => Table::Discrete,
        };
        let found = peek::registers(&place, &speed, args.unit, table, (first, count)).map_err(failed)?;
        registers(first, &found, json);
    } else if let PeekAddress::Can(name) = &place {
        frames(&peek::frames(name, args.bitrate, long).map_err(failed)?, long, json);
    } else if args.address.starts_with("rtu:") {
        miette::bail!(
            help = "as in muprime doctor peek rtu:/dev/ttyUSB0 100..103 --unit 1; without rtu: the line is listened to",
            "say which registers to read from {}",
            args.address
        );
    } else {
        lines(&peek::bytes(&place, &speed, long).map_err(failed)?, long, json);
    }
    exit(DONE)
}

/// The number of two registers in both orders of their words: high word first, low word first.
fn both(high: u16, low: u16) -> [u32; 2] {
    [(u32::from(high) << 16) | u32::from(low), (u32::from(low) << 16) | u32::from(high)]
}

/// A float for people; a dash where it is surely none.
fn float(bits: u32) -> String {
    match f32::from_bits(bits) {
        0.0 => "0".into(),
        x if !(1e-9..1e12).contains(&x.abs()) => "-".into(),
        x if (1e-3..1e6).contains(&x.abs()) => format!("{x:.4}"),
        x => format!("{x:.3e}"),
    }
}

fn registers(first: u16, found: &[u16], json: bool) {
    if !json {
        out!("                             high word first         low word first");
        out!("register    hex    u16    i16        u32         f32        u32         f32");
    }
    for (i, &word) in found.iter().enumerate() {
        let at = usize::from(first) + i;
        let pair = found.get(i + 1).map(|next| both(word, *next));
        if json {
            let floats =
                pair.map(|pair| pair.map(|bits| Some(f32::from_bits(bits)).filter(|x| x.is_finite())));
            let signed = pair.map(|pair| pair.map(u32::cast_signed));
            answer_json(&json!({
                "register": at, "u16": word, "i16": word.cast_signed(), "u32": pair, "i32": signed,
                "f32": floats,
            }));
            continue;
        }
        let wide = pair.map_or_else(String::new, |[high, low]| {
            format!(" {high:>10} {:>11} {low:>10} {:>11}", float(high), float(low))
        });
        out!("{at:>8} {:>6} {word:>6} {:>6}{wide}", format!("{word:#06x}"), word.cast_signed());
    }
}

fn hex(data: &[u8]) -> String {
    data.iter().map(|byte| format!("{byte:02x}")).collect::<Vec<_>>().join(" ")
}

fn frames(seen: &std::collections::BTreeMap<(u32, bool), peek::Frames>, long: Duration, json: bool) {
    if !json {
        out!("identifier  frames per s  last data");
    }
    for ((id, extended), of) in seen {
        let rate = f64::from(of.count) / long.as_secs_f64();
        if json {
            let data = hex(&of.data);
            answer_json(
                &json!({ "id": id, "extended": extended, "frames": of.count, "rate_hz": rate, "data": data }),
            );
        } else {
            let id = if *extended { format!("{id:#010x}") } else { format!("{id:#05x}") };
            out!("{id:>10}  {rate:>12.1}  {}", hex(&of.data));
        }
    }
    if seen.is_empty() && !json {
        out!("no frame in {:.1} s; check bit rate, termination and power", long.as_secs_f64());
    }
}

/// Lines as they came, each with its end; bytes that cannot be seen as escapes.
fn lines(came: &[u8], long: Duration, json: bool) {
    let mut all = came.split_inclusive(|byte| *byte == b'\n').peekable();
    if all.peek().is_none() && !json {
        out!(
            "nothing in {:.1} s; the instrument may wait for a question, or the speed is wrong",
            long.as_secs_f64()
        );
    }
    for line in all {
        let shown = drivers::remedy::shown(line);
        if json {
            answer_json(&json!({ "line": shown, "hex": hex(line) }));
        } else {
            out!("{shown}");
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_include_both_ends_and_stay_small() {
        assert_eq!(range("100..103"), Ok((100, 4)));
        assert_eq!(range("7"), Ok((7, 1)));
        assert_eq!(range("0..124"), Ok((0, 125)));
        for wrong in ["0..125", "5..4", "a..b", "0..65536", "", "-1..2"] {
            assert!(range(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn no_duration_is_cut_silently() {
        assert_eq!(duration("0.5"), Ok(Duration::from_millis(500)));
        for wrong in ["0", "61", "nan", "inf", "-1", "soon"] {
            assert!(duration(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn words_in_both_orders() {
        assert_eq!(both(0x41C8, 0).map(float), ["25.0000".to_string(), "-".into()]);
        assert_eq!(both(0, 0x41C8).map(float)[1], "25.0000");
        assert_eq!(float(f32::NAN.to_bits()), "-");
    }
}
