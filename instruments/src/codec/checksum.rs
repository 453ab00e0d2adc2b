//! The checks that frames end with.

use crc::{Algorithm, Crc, Table};
use schemars::JsonSchema;
use serde::Deserialize;

/// A cyclic redundancy check of whole bytes from the catalogue of parametrised CRC algorithms, by the width of its register.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Cyclic {
    /// 8 bits.
    W8(&'static Algorithm<u8>),
    /// 16 bits.
    W16(&'static Algorithm<u16>),
    /// 24 or 32 bits.
    W32(&'static Algorithm<u32>),
    /// 40 or 64 bits.
    W64(&'static Algorithm<u64>),
}

impl Cyclic {
    /// Bits, whether it is reflected, and the check of `body`. Without a table: frames are short.
    fn parts(self, body: Option<&[u8]>) -> (u8, bool, u64) {
        macro_rules! parts {
            ($type:ty, $of:expr) => {{
                let value = body.map_or(0, |body| u64::from(Crc::<$type, Table<0>>::new($of).checksum(body)));
                ($of.width, $of.refout, value)
            }};
        }
        match self {
            Self::W8(of) => parts!(u8, of),
            Self::W16(of) => parts!(u16, of),
            Self::W32(of) => parts!(u32, of),
            Self::W64(of) => parts!(u64, of),
        }
    }
}

/// A check, and the other names that the catalogue gives it, as they are compared: capitals, `_` for what is
/// not a letter or digit.
const ALIASES: &[(&str, &[&str])] = &[
    ("CRC_8_SMBUS", &["CRC_8"]),
    ("CRC_8_I_432_1", &["CRC_8_ITU"]),
    ("CRC_8_MAXIM_DOW", &["CRC_8_MAXIM", "DOW_CRC"]),
    ("CRC_8_TECH_3250", &["CRC_8_AES"]),
    ("CRC_16_ARC", &["ARC", "CRC_16", "CRC_16_LHA", "CRC_IBM"]),
    ("CRC_16_IBM_3740", &["CRC_16_AUTOSAR", "CRC_16_CCITT_FALSE"]),
    ("CRC_16_SPI_FUJITSU", &["CRC_16_AUG_CCITT"]),
    ("CRC_16_KERMIT", &["CRC_16_BLUETOOTH", "CRC_16_CCITT", "CRC_16_CCITT_TRUE", "CRC_CCITT", "KERMIT"]),
    ("CRC_16_MODBUS", &["CRC16_MODBUS", "MODBUS"]),
    (
        "CRC_16_IBM_SDLC",
        &["CRC16_X25", "CRC_16_ISO_HDLC", "CRC_16_ISO_IEC_14443_3_B", "CRC_16_X_25", "CRC_B", "X_25"],
    ),
    ("CRC_16_MAXIM_DOW", &["CRC_16_MAXIM"]),
    ("CRC_16_UMTS", &["CRC_16_BUYPASS", "CRC_16_VERIFONE"]),
    ("CRC_16_XMODEM", &["CRC_16_ACORN", "CRC_16_LTE", "XMODEM", "ZMODEM"]),
    ("CRC_32_ISO_HDLC", &["CRC_32", "CRC_32_ADCCP", "CRC_32_V_42", "CRC_32_XZ", "PKZIP"]),
    ("CRC_32_ISCSI", &["CRC_32_CASTAGNOLI", "CRC_32C"]),
    ("CRC_32_BZIP2", &["CRC_32_AAL5"]),
    ("CRC_32_CKSUM", &["CRC_32_POSIX", "CKSUM"]),
];

macro_rules! catalogue {
    ($($width:ident: $($name:ident)+;)+) => {
        /// Names as the crate spells them.
        const CATALOGUE: &[(&str, Cyclic)] = &[$($((stringify!($name), Cyclic::$width(&crc::$name)),)+)+];
    };
}

catalogue! {
    W8: CRC_8_AUTOSAR CRC_8_BLUETOOTH CRC_8_CDMA2000 CRC_8_DARC CRC_8_DVB_S2 CRC_8_GSM_A CRC_8_GSM_B CRC_8_HITAG CRC_8_I_432_1
        CRC_8_I_CODE CRC_8_LTE CRC_8_MAXIM_DOW CRC_8_MIFARE_MAD CRC_8_NRSC_5 CRC_8_OPENSAFETY CRC_8_ROHC CRC_8_SAE_J1850
        CRC_8_SMBUS CRC_8_TECH_3250 CRC_8_WCDMA;
    W16: CRC_16_ARC CRC_16_CDMA2000 CRC_16_CMS CRC_16_DDS_110 CRC_16_DECT_R CRC_16_DECT_X CRC_16_DNP CRC_16_EN_13757
        CRC_16_GENIBUS CRC_16_GSM CRC_16_IBM_3740 CRC_16_IBM_SDLC CRC_16_ISO_IEC_14443_3_A CRC_16_KERMIT CRC_16_LJ1200
        CRC_16_M17 CRC_16_MAXIM_DOW CRC_16_MCRF4XX CRC_16_MODBUS CRC_16_NRSC_5 CRC_16_OPENSAFETY_A CRC_16_OPENSAFETY_B
        CRC_16_PROFIBUS CRC_16_RIELLO CRC_16_SPI_FUJITSU CRC_16_T10_DIF CRC_16_TELEDISK CRC_16_TMS37157 CRC_16_UMTS
        CRC_16_USB CRC_16_XMODEM;
    W32: CRC_24_BLE CRC_24_FLEXRAY_A CRC_24_FLEXRAY_B CRC_24_INTERLAKEN CRC_24_LTE_A CRC_24_LTE_B CRC_24_OPENPGP CRC_24_OS_9
        CRC_32_AIXM CRC_32_AUTOSAR CRC_32_BASE91_D CRC_32_BZIP2 CRC_32_CD_ROM_EDC CRC_32_CKSUM CRC_32_ISCSI
        CRC_32_ISO_HDLC CRC_32_JAMCRC CRC_32_MEF CRC_32_MPEG_2 CRC_32_XFER;
    W64: CRC_40_GSM CRC_64_ECMA_182 CRC_64_GO_ISO CRC_64_MS CRC_64_NVME CRC_64_REDIS CRC_64_WE CRC_64_XZ;
}

/// A check, by its name: `sum7-with-error-bit` (bit 7 says that the instrument has an error, bits 0 to 6 are the sum of all
/// bytes before), `sum8`, `xor8`, or a CRC of 8 to 64 bits by its name in the catalogue, such as `CRC-16/MODBUS`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(try_from = "String")]
#[schemars(with = "String")]
pub enum Check {
    /// One byte: bit 7 says that the instrument has an error, bits 0 to 6 are the sum of all bytes before it.
    Sum7WithErrorBit,
    /// One byte: the sum of all bytes, modulo 256.
    Sum8,
    /// One byte: the exclusive or of all bytes.
    Xor8,
    /// A cyclic redundancy check.
    Crc(Cyclic),
}

/// A name that no check has.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error(
    "no check is called `{name}`; sum8, xor8, sum7-with-error-bit, or a CRC by its name in the catalogue, \
     such as {alike}"
)]
pub struct UnknownCheck {
    /// The name.
    pub name: String,
    /// CRCs of the same width, else the usual ones.
    pub alike: String,
}

impl TryFrom<String> for Check {
    type Error = UnknownCheck;

    fn try_from(name: String) -> Result<Self, UnknownCheck> {
        let upper = |c: char| if c.is_ascii_alphanumeric() { c.to_ascii_uppercase() } else { '_' };
        let spelt: String = name.chars().map(upper).collect();
        Ok(match spelt.as_str() {
            "SUM7_WITH_ERROR_BIT" => Self::Sum7WithErrorBit,
            "SUM8" => Self::Sum8,
            "XOR8" => Self::Xor8,
            other => {
                let meant = ALIASES
                    .iter()
                    .find(|(_, aliases)| aliases.contains(&other))
                    .map_or(other, |(meant, _)| meant);
                let found = CATALOGUE.iter().find(|(known, _)| *known == meant);
                let unknown = || {
                    // The ones of the same width: the usual remedy is to choose one of them.
                    let width = spelt.split('_').find(|part| part.chars().all(|c| c.is_ascii_digit()));
                    let wide = width.map(|width| format!("CRC_{width}_"));
                    let alike = CATALOGUE
                        .iter()
                        .filter(|(known, _)| wide.as_ref().is_some_and(|wide| known.starts_with(wide)));
                    // As the catalogue writes them.
                    let written = |(known, _): &(&str, Cyclic)| {
                        known.replacen('_', "-", 1).replacen('_', "/", 1).replace('_', "-")
                    };
                    let alike = alike.map(written).collect::<Vec<_>>().join(", ");
                    let usual = || "CRC-16/MODBUS, CRC-32/ISO-HDLC".into();
                    let alike = Some(alike).filter(|alike| !alike.is_empty()).unwrap_or_else(usual);
                    UnknownCheck { name: name.clone(), alike }
                };
                Self::Crc(found.ok_or_else(unknown)?.1)
            }
        })
    }
}

impl Check {
    /// CRC-16/MODBUS.
    pub const CRC_16_MODBUS: Self = Self::Crc(Cyclic::W16(&crc::CRC_16_MODBUS));

    /// Its name, a CRC's as the crate crc spells it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Sum7WithErrorBit => "sum7-with-error-bit",
            Self::Sum8 => "sum8",
            Self::Xor8 => "xor8",
            Self::Crc(cyclic) => {
                CATALOGUE.iter().find(|(_, known)| *known == cyclic).map_or("CRC", |(name, _)| name)
            }
        }
    }

    /// Bytes that the check takes.
    pub fn length(self) -> usize {
        if let Self::Crc(cyclic) = self { usize::from(cyclic.parts(None).0 / 8) } else { 1 }
    }

    /// The check of `body`, as the frame has it. `high_first`: its high byte comes first; left out, so
    /// it is with checks that are not reflected, as is usual.
    pub fn of(self, body: &[u8], high_first: Option<bool>) -> Vec<u8> {
        match self {
            Self::Sum7WithErrorBit => vec![sum(body) & 0x7F],
            Self::Sum8 => vec![sum(body)],
            Self::Xor8 => vec![body.iter().fold(0, |all, byte| all ^ byte)],
            Self::Crc(cyclic) => {
                let (bits, reflected, value) = cyclic.parts(Some(body));
                let mut bytes = value.to_le_bytes()[..usize::from(bits / 8)].to_vec();
                if high_first.unwrap_or(!reflected) {
                    bytes.reverse();
                }
                bytes
            }
        }
    }

    /// Whether `check` fits `body`.
    pub fn holds(self, body: &[u8], check: &[u8], high_first: Option<bool>) -> bool {
        match self {
            Self::Sum7WithErrorBit => check.len() == 1 && check[0] & 0x7F == sum(body) & 0x7F,
            _ => check == self.of(body, high_first),
        }
    }
}

fn sum(body: &[u8]) -> u8 {
    body.iter().fold(0_u8, |sum, byte| sum.wrapping_add(*byte))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn named(name: &str) -> Check {
        Check::try_from(name.to_string()).unwrap()
    }

    /// The catalogue's check values of '123456789', and ATI's published stream start frame.
    #[test]
    fn published_values() {
        assert_eq!(named("crc16-x25").of(b"123456789", None), 0x906E_u16.to_le_bytes());
        assert_eq!(named("crc16-modbus").of(b"123456789", None), 0x4B37_u16.to_le_bytes());
        assert_eq!(Check::CRC_16_MODBUS.of(&[0x0A, 0x46, 0x55], None), [0xA3, 0x9D]);
        assert_eq!(
            named("CRC-16/XMODEM").of(b"123456789", None),
            [0x31, 0xC3],
            "not reflected: high byte first"
        );
        assert_eq!(named("CRC-16/XMODEM").of(b"123456789", Some(false)), [0xC3, 0x31]);
        assert_eq!(named("CRC-8/SMBUS").of(b"123456789", None), [0xF4]);
        assert_eq!(named("CRC-24/OPENPGP").of(b"123456789", None), [0x21, 0xCF, 0x02]);
        assert_eq!(named("CRC-32/ISO-HDLC").of(b"123456789", None), 0xCBF4_3926_u32.to_le_bytes());
        assert_eq!(named("crc-64/xz").of(b"123456789", None), 0x995D_C9BB_DF19_39FA_u64.to_le_bytes());
        assert_eq!(named("xor8").of(b"123456789", None), [0x31]);
        assert_eq!(named("sum8").of(b"123456789", None), [0xDD]);
        let unknown = Check::try_from("CRC-16/MOBDUS".to_string()).unwrap_err().to_string();
        assert!(unknown.contains("CRC-16/MODBUS"), "{unknown}");
    }

    #[test]
    fn a_check_is_as_long_as_it_says_and_holds_for_no_other_body() {
        for (name, cyclic) in CATALOGUE {
            let check = Check::Crc(*cyclic);
            assert_eq!(Check::try_from((*name).to_string()), Ok(check));
            let sent = check.of(b"muprime", None);
            assert_eq!(sent.len(), check.length(), "{name}");
            assert!(check.holds(b"muprime", &sent, None) && !check.holds(b"muprimf", &sent, None), "{name}");
        }
    }

    /// The catalogue's check values, of the digits 1 to 9.
    #[test]
    fn the_other_names_stand_for_what_the_catalogue_says() {
        for (meant, aliases) in ALIASES {
            assert!(CATALOGUE.iter().any(|(known, _)| known == meant), "{meant}");
            for alias in *aliases {
                assert!(Check::try_from((*alias).to_string()).is_ok(), "{alias}");
            }
        }
        for (name, value) in [
            ("CRC-16/CCITT-FALSE", 0x29B1_u32),
            ("XMODEM", 0x31C3),
            ("KERMIT", 0x2189),
            ("CRC-16/X-25", 0x906E),
            ("ARC", 0xBB3D),
            ("MODBUS", 0x4B37),
            ("CRC-16/AUG-CCITT", 0xE5CC),
            ("CRC-32", 0xCBF4_3926),
            ("CRC-32C", 0xE306_9283),
            ("CRC-8", 0xF4),
        ] {
            let check = Check::try_from(name.to_string()).unwrap();
            let high_first = check.of(b"123456789", Some(true));
            let found = high_first.iter().fold(0_u32, |all, byte| all << 8 | u32::from(*byte));
            assert_eq!(found, value, "{name}");
        }
    }

    #[test]
    fn the_error_bit_is_no_part_of_the_sum() {
        let holds = |check: u8| Check::Sum7WithErrorBit.holds(&[1, 2, 3], &[check], None);
        assert!(holds(0x06) && holds(0x86) && !holds(0x07));
    }
}
