//! Cases that hash and do nothing else: what worker, engine and file system cost beside them is measured with these.

use super::{Case, CaseKind, Cell, no_lines, settings, text};
use crate::cases::file::{Header, hex};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

/// The kind.
pub const KIND: CaseKind = CaseKind {
    name: "noop",
    words: "hashes so many times: measures what a study costs beside its cases",
    model: 1,
    columns: &[text("digest", "SHA-256 of the index, hashed so many times, its first eight bytes")],
    prepare,
};

/// What all cases share, and options of the command line.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, clap::Args)]
#[serde(default, deny_unknown_fields)]
pub struct NoopSettings {
    /// Hashes of each: some five million a second
    #[arg(long, default_value_t = 0)]
    pub hashes: u64,
}

fn prepare(header: &Header, _: &std::path::Path) -> miette::Result<super::Make> {
    no_lines(header)?;
    let NoopSettings { hashes } = settings(header)?;
    Ok(Box::new(move |index, _| {
        let run = move || {
            let mut digest: [u8; 32] = Sha256::digest(index.to_le_bytes()).into();
            for _ in 0..hashes {
                digest = Sha256::digest(digest).into();
            }
            Ok(vec![Cell::Text(hex(&digest[..8]))])
        };
        Ok(Case { inputs: format!("{index} {hashes}"), run: Box::new(run) })
    }))
}
