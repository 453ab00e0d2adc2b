//! CANopen objects by an electronic data sheet (CiA 306): an INI file with a section for each object.

use crate::field::NumberType;
use std::collections::BTreeMap;

/// Index and subindex.
pub type Key = (u16, u8);

/// The objects of a data sheet.
pub type Objects = BTreeMap<Key, Object>;

/// A value that may depend on the node's number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct DefaultValue {
    /// The value, less the node's number where that is added.
    pub value: i64,
    /// Whether the node's number is added (`$NODEID+0x180`).
    pub plus_node: bool,
}

/// What is wrong with a data sheet; keys of objects are index and subindex.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[allow(missing_docs, reason = "the message of an error says what it is")]
pub enum SheetError {
    #[error("line {line}: a section needs a `]`")]
    Section { line: usize },
    #[error("line {line}: `{text}` is no `key=value`")]
    Entry { line: usize, text: String },
    #[error("line {line}: {name} of object {:04X}sub{}: `{text}` is not a number", .object.0, .object.1)]
    Number { line: usize, name: &'static str, object: Key, text: String },
    #[error("object {:04X}sub{} has no DataType", .0.0, .0.1)]
    NoType(Key),
    #[error("object {:04X}sub{} is described twice", .0.0, .0.1)]
    Twice(Key),
    #[error("there is no object in it")]
    Empty,
    #[error(
        "object {index:04X}sub1: the data sheet switches the frame {cob:#x} off (bit 31 of its identifier)"
    )]
    Off { index: u16, cob: u32 },
    #[error(
        "the data sheet has no process data with identifier {cob:#x} plus the node's number; it has {known}"
    )]
    NoFrame { cob: u32, known: String },
    #[error("object {0:04X}sub0 has no default: nothing is mapped")]
    Unmapped(u16),
    #[error("object {:04X}sub{} has no default", .0.0, .0.1)]
    NoDefault(Key),
    #[error("object {:04X}sub{} maps {bits} bits: only whole bytes are read", .entry.0, .entry.1)]
    PartOfByte { entry: Key, bits: usize },
    #[error(
        "object {:04X}sub{} maps {bits} bits of {:04X}sub{}, which has {stored:?}",
        .entry.0, .entry.1, .object.0, .object.1
    )]
    OtherLength { entry: Key, bits: usize, object: Key, stored: Option<usize> },
    #[error("object {index:04X} maps {bytes} bytes; a frame has 8")]
    TooLong { index: u16, bytes: usize },
}

/// One object.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Object {
    /// Name.
    pub name: String,
    /// Number of its type (CiA 301, table 44).
    pub data_type: u16,
    /// `ro`, `wo`, `rw`, `rwr`, `rww` or `const`.
    pub access: String,
    /// Value after power-on, where the data sheet states a whole number: that of the device as it is
    /// configured (`ParameterValue`), else its maker's (`DefaultValue`).
    pub default: Option<DefaultValue>,
}

impl Object {
    /// How it is stored; `None` for texts, domains and numbers of more than 32 bits.
    pub const fn number(&self) -> Option<NumberType> {
        match self.data_type {
            1 | 5 => Some(NumberType::U8),
            2 => Some(NumberType::I8),
            3 => Some(NumberType::I16),
            4 => Some(NumberType::I32),
            6 => Some(NumberType::U16),
            7 => Some(NumberType::U32),
            8 => Some(NumberType::F32),
            _ => None,
        }
    }

    /// Whether it can be written.
    pub fn writable(&self) -> bool {
        matches!(self.access.as_str(), "wo" | "rw" | "rwr" | "rww")
    }
}

/// Reads a data sheet. Objects without sub-objects have subindex 0.
///
/// # Errors
/// What is wrong, with the line.
pub fn parse(text: &str) -> Result<Objects, SheetError> {
    let mut objects = Objects::new();
    let mut section: Option<(Key, BTreeMap<String, (String, usize)>)> = None;
    for (number, line) in text.lines().enumerate().map(|(i, line)| (i + 1, line.trim())) {
        if line.is_empty() || line.starts_with([';', '#']) {
            continue;
        }
        if let Some(name) = line.strip_prefix('[') {
            let name = name.strip_suffix(']').ok_or(SheetError::Section { line: number })?;
            close(&mut objects, section.take())?;
            section = key(name).map(|key| (key, BTreeMap::new()));
            continue;
        }
        let no_entry = || SheetError::Entry { line: number, text: line.into() };
        let (name, value) = line.split_once('=').ok_or_else(no_entry)?;
        if let Some((_, entries)) = &mut section {
            // A remark stands behind a blank and a semicolon.
            let value = value.find(" ;").or(value.find("\t;")).map_or(value, |at| &value[..at]);
            entries.insert(name.trim().to_ascii_lowercase(), (value.trim().to_string(), number));
        }
    }
    close(&mut objects, section)?;
    if objects.is_empty() { Err(SheetError::Empty) } else { Ok(objects) }
}

/// The object that a section such as `6040` or `1018sub1` describes; other sections describe none.
fn key(section: &str) -> Option<Key> {
    let lower = section.to_ascii_lowercase();
    let (index, sub) = lower.split_once("sub").unwrap_or((&lower, "0"));
    if index.len() != 4 {
        return None;
    }
    Some((u16::from_str_radix(index, 16).ok()?, u8::from_str_radix(sub, 16).ok()?))
}

/// Takes a whole section; the head of a record or an array (object type 8 or 9) is not an object of its own.
fn close(
    objects: &mut Objects,
    section: Option<(Key, BTreeMap<String, (String, usize)>)>,
) -> Result<(), SheetError> {
    let Some((key, entries)) = section else { return Ok(()) };
    let (index, sub) = key;
    let entry = |name: &str| entries.get(name).map(|(value, _)| value.as_str()).filter(|v| !v.is_empty());
    let wrong = |name: &'static str, text: &str| {
        let line = entries.get(name).map_or(0, |(_, line)| *line);
        SheetError::Number { line, name, object: key, text: text.into() }
    };
    let whole =
        |name: &'static str| entry(name).map(|text| self::number(text).ok_or(wrong(name, text))).transpose();
    let compact = whole("compactsubobj")?.filter(|count| *count > 0);
    if compact.is_none() && matches!(whole("objecttype")?, Some(8 | 9)) {
        return Ok(());
    }
    let data_type = whole("datatype")?.and_then(|kind| u16::try_from(kind).ok());
    let data_type = data_type.ok_or(SheetError::NoType(key))?;
    let access = entry("accesstype").unwrap_or("rw").to_ascii_lowercase();
    let default = entry("parametervalue").or_else(|| entry("defaultvalue")).and_then(default_of);
    let name = entry("parametername").unwrap_or_default().to_string();
    let object = Object { name, data_type, access, default };
    let mut put = |sub: u8, object: Object| match objects.insert((index, sub), object) {
        Some(_) => Err(SheetError::Twice((index, sub))),
        None => Ok(()),
    };
    let Some(count) = compact else { return put(sub, object) };
    // An array in one section (CiA 306, 4.6.3.3): how many there are, then that many of one kind. Values of
    // single ones are elsewhere, so none is known here.
    let count = u8::try_from(count).ok().filter(|count| *count < 255);
    let count = count.ok_or_else(|| wrong("CompactSubObj", entry("compactsubobj").unwrap_or_default()))?;
    let number = DefaultValue { value: count.into(), plus_node: false };
    put(0, Object { name: "NrOfObjects".into(), data_type: 5, access: "ro".into(), default: Some(number) })?;
    (1..=count).try_for_each(|sub| put(sub, Object { default: None, ..object.clone() }))
}

/// A whole number: decimal, or hexadecimal after `0x`.
fn number(text: &str) -> Option<i64> {
    let (sign, digits) = text.strip_prefix('-').map_or((1, text), |rest| (-1, rest));
    let hex = digits.strip_prefix("0x").or(digits.strip_prefix("0X"));
    let value = hex.map_or_else(|| digits.parse().ok(), |hex| i64::from_str_radix(hex, 16).ok())?;
    i64::checked_mul(sign, value)
}

/// A default: a whole number, with or without the node's.
fn default_of(text: &str) -> Option<DefaultValue> {
    let upper: String = text.to_ascii_uppercase().split_whitespace().collect();
    let without = upper.strip_prefix("$NODEID+").or(upper.strip_suffix("+$NODEID"));
    if upper == "$NODEID" {
        return Some(DefaultValue { value: 0, plus_node: true });
    }
    let plus_node = without.is_some();
    number(without.unwrap_or(&upper)).map(|value| DefaultValue { value, plus_node })
}

/// What a process data frame holds: each object with its first byte. `first` is 0x1800 for what the node
/// sends and 0x1400 for what it takes; `cob` is the frame's identifier less the node's number.
///
/// # Errors
/// Where the data sheet has no such frame that is switched on, or one that is not made of whole bytes.
pub fn mapping(objects: &Objects, first: u16, cob: u32) -> Result<(Vec<(Key, usize)>, usize), SheetError> {
    let frame = |(&(index, sub), object): (&Key, &Object)| {
        let within = (first..first + 0x200).contains(&index) && sub == 1;
        object.default.filter(|_| within).map(|identifier| (index, identifier))
    };
    let frames: Vec<(u16, DefaultValue)> = objects.iter().filter_map(frame).collect();
    // A sheet that was configured for one node may state its identifier as a whole; only what the base of a
    // frame leaves can be a node's number.
    let of_node = |d: &DefaultValue| {
        let (id, cob) = (d.value & 0x7FF, i64::from(cob));
        id == cob || !d.plus_node && id > cob && id <= cob + 127 && id & !127 == cob
    };
    // Bits 31 and 30 say 'not used' and 'no remote request'.
    let (off, on): (Vec<_>, Vec<_>) =
        frames.iter().filter(|(_, d)| of_node(d)).partition(|(_, d)| d.value & 0x8000_0000 != 0);
    let communication = match (&on[..], &off[..]) {
        ([(index, _), ..], _) => *index,
        ([], [(index, _), ..]) => return Err(SheetError::Off { index: *index, cob }),
        _ => {
            let on = frames.iter().filter(|(_, d)| d.value & 0x8000_0000 == 0);
            let plus = |d: &DefaultValue| if d.plus_node { " plus the node's number" } else { "" };
            let known: Vec<String> = on.map(|(_, d)| format!("{:#x}{}", d.value & 0x7FF, plus(d))).collect();
            let known = if known.is_empty() { "none".into() } else { known.join(", ") };
            return Err(SheetError::NoFrame { cob, known });
        }
    };
    let map = communication + 0x200;
    let value = |sub: u8| objects.get(&(map, sub)).and_then(|object| object.default).map(|d| d.value);
    let count = value(0).ok_or(SheetError::Unmapped(map))?;
    let (mut placed, mut at) = (Vec::new(), 0);
    for sub in 1..=u8::try_from(count).unwrap_or(0) {
        // Index, subindex, length in bits (CiA 301, 7.5.2.36).
        let entry = value(sub).ok_or(SheetError::NoDefault((map, sub)))?;
        // taken apart byte by byte
        let (key, bits) = (((entry >> 16) as u16, (entry >> 8) as u8), (entry & 0xFF) as usize);
        if bits % 8 != 0 || bits == 0 {
            return Err(SheetError::PartOfByte { entry: (map, sub), bits });
        }
        let stored = objects.get(&key).and_then(Object::number).map(|number| 8 * number.bytes());
        if stored != Some(bits) {
            return Err(SheetError::OtherLength { entry: (map, sub), bits, object: key, stored });
        }
        placed.push((key, at));
        at += bits / 8;
    }
    if at > 8 { Err(SheetError::TooLong { index: map, bytes: at }) } else { Ok((placed, at)) }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SHEET: &str = "; a comment\n[FileInfo]\nFileName=a.eds\n[1018]\nObjectType=0x9\nSubNumber=2\n\
        [1018sub1]\nParameterName=Vendor-ID\nObjectType=0x7\nDataType=0x0007\nAccessType=ro\nDefaultValue=0x1\n\
        [1800sub1]\nParameterName=COB-ID\nDataType=7\nAccessType=rw\nDefaultValue=$NODEID+0x40000180\n\
        [1A00sub0]\nDataType=5\nAccessType=rw\nDefaultValue=2\n\
        [1a00sub1]\nDataType=7\nAccessType=rw\nDefaultValue=0x60410010\n\
        [1A00sub2]\nDataType=7\nAccessType=rw\nDefaultValue=0x60640020\n\
        [6041]\nDataType=6\nAccessType=ro\n[6064]\nDataType=4\nAccessType=ro\nDefaultValue=-5\n";

    #[test]
    fn objects_and_process_data() {
        let objects = parse(SHEET).unwrap();
        assert_eq!(objects.len(), 7, "the head of the record is none: {objects:?}");
        assert_eq!(objects[&(0x1018, 1)].default, Some(DefaultValue { value: 1, plus_node: false }));
        assert_eq!(objects[&(0x6064, 0)].default.unwrap().value, -5);
        assert!(!objects[&(0x6064, 0)].writable() && objects[&(0x1A00, 0)].writable());
        let (placed, length) = mapping(&objects, 0x1800, 0x180).unwrap();
        assert_eq!((placed, length), (vec![((0x6041, 0), 0), ((0x6064, 0), 2)], 6));
        assert!(mapping(&objects, 0x1800, 0x280).unwrap_err().to_string().contains("0x280"));
        let wrong = SHEET.replace("0x60640020", "0x60640010");
        assert!(
            mapping(&parse(&wrong).unwrap(), 0x1800, 0x180).unwrap_err().to_string().contains("16 bits"),
            "i32 in 16 bits"
        );
    }

    #[test]
    fn configured_sheets_compact_arrays_and_frames_that_are_off() {
        let map = |sheet: &str| mapping(&parse(sheet).unwrap(), 0x1800, 0x180);
        let configured = SHEET
            .replace("DefaultValue=0x60640020", "DefaultValue=0x60640020\nParameterValue=0x606C0020 ; speed")
            + "[606C]\nDataType=4\nAccessType=ro\n";
        assert_eq!(map(&configured).unwrap().0[1].0, (0x606C, 0));
        let off = SHEET.replace("0x40000180", "0xC0000180");
        assert!(
            map(&off).unwrap_err().to_string().contains("1800sub1")
                && map(&off).unwrap_err().to_string().contains("off")
        );
        let another = off
            + "[1801sub1]\nDataType=7\nDefaultValue=$NODEID+0x180\n[1A01sub0]\nDataType=5\nDefaultValue=1\n\
            [1A01sub1]\nDataType=7\nDefaultValue=0x60410010\n";
        assert_eq!(map(&another).unwrap(), (vec![((0x6041, 0), 0)], 2), "the one that is on");
        assert_eq!(map(&SHEET.replace("$NODEID+0x40000180", "0x185")), map(SHEET), "of node 5");
        assert!(
            map(&SHEET.replace("$NODEID+0x40000180", "0x285")).unwrap_err().to_string().contains("0x285")
        );
        let compact = format!(
            "{SHEET}[2000]\nObjectType=8\nDataType=6\nAccessType=rw\nDefaultValue=7\nCompactSubObj=3\n"
        );
        let objects = parse(&compact).unwrap();
        assert_eq!(objects[&(0x2000, 0)].default.unwrap().value, 3);
        assert!(objects[&(0x2000, 3)].data_type == 6 && !objects.contains_key(&(0x2000, 4)));
    }

    #[test]
    fn what_is_wrong_is_told_with_its_line() {
        assert!(parse("[6041\n").unwrap_err().to_string().contains("line 1"));
        assert!(parse("[6041]\nDataType=six\n").unwrap_err().to_string().contains("line 2"));
        assert!(parse("[6041]\nAccessType=ro\n").unwrap_err().to_string().contains("DataType"));
        assert!(parse("[6041]\nDataType=6\n[6041]\nDataType=6\n").unwrap_err().to_string().contains("twice"));
        assert!(parse("nonsense").unwrap_err().to_string().contains("line 1"));
    }
}
