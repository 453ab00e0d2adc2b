//! The licence of the data of a run: an SPDX identifier or an address.

/// Common identifiers of the SPDX list (<https://spdx.org/licenses>): those for data, and those for programs.
const KNOWN: &str = "CC0-1.0 CC-BY-3.0 CC-BY-4.0 CC-BY-SA-3.0 CC-BY-SA-4.0 CC-BY-NC-4.0 CC-BY-ND-4.0 CC-BY-NC-SA-4.0 \
    CC-BY-NC-ND-4.0 PDDL-1.0 ODbL-1.0 ODC-By-1.0 CDLA-Permissive-1.0 CDLA-Permissive-2.0 CDLA-Sharing-1.0 C-UDA-1.0 \
    O-UDA-1.0 DL-DE-BY-2.0 DL-DE-ZERO-2.0 etalab-2.0 OGL-UK-3.0 EUPL-1.2 MIT MIT-0 Apache-2.0 BSD-2-Clause \
    BSD-3-Clause 0BSD ISC Unlicense MPL-2.0 GPL-2.0-only GPL-2.0-or-later GPL-3.0-only GPL-3.0-or-later \
    LGPL-3.0-or-later AGPL-3.0-only AGPL-3.0-or-later";

/// The address of a licence: of an SPDX identifier its page, of an address itself.
///
/// # Errors
/// A text that is neither: repositories would publish a dead link.
pub fn address_of(licence: &str) -> miette::Result<String> {
    let address = ["https://", "http://"].iter().any(|scheme| {
        licence.strip_prefix(scheme).is_some_and(|host| host.starts_with(|c: char| c.is_alphanumeric()))
    });
    if address && !licence.contains(|c: char| c.is_whitespace() || c.is_control()) {
        return Ok(licence.into());
    }
    let known = KNOWN.split(' ').find(|known| known.eq_ignore_ascii_case(licence));
    known.map(|known| format!("https://spdx.org/licenses/{known}")).ok_or_else(|| {
        miette::miette!(
            help = "give an SPDX identifier (CC-BY-4.0, CC0-1.0, ODbL-1.0, MIT and others), or the address of the text, \
                    https://spdx.org/licenses/NAME for one that is seldom used",
            "the licence '{licence}' is no common SPDX identifier and no address"
        )
    })
}

#[cfg(test)]
mod tests {
    use super::address_of;

    #[test]
    fn a_licence_is_an_identifier_or_an_address() {
        let page = "https://spdx.org/licenses/CC-BY-4.0";
        for good in ["CC-BY-4.0", "cc-by-4.0", page] {
            assert_eq!(address_of(good).unwrap(), page);
        }
        for bad in ["", "free for all", "CC-BY", "x://y", "https://", "https://a b", "javascript://x"] {
            assert!(address_of(bad).is_err(), "{bad}");
        }
    }
}
