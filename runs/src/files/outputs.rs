//! What an output may take the place of: an earlier output of the same kind, and nothing else. A person who
//! mixes up two names loses no data.

use super::write_whole;
use std::fs::{self, File};
use std::io::{Read, Seek, SeekFrom};
use std::path::Path;

/// What a page begins with, up to its title.
pub const PAGE: &[u8] = b"<!doctype html><title>muprime: ";
/// What a corrected model begins with.
pub const MODEL: &[u8] = b"schema = \"muprime.model/1\"\n";
/// What a plan of the next experiment begins with; a plan of a person has other words of its own.
pub const NEXT_PLAN: &[u8] = b"# Written by muprime diagnose.\nname = \"next-experiment\"\n";
/// What a table of predictions begins with.
pub const PREDICTIONS: &[u8] = b"point,lateral_force_baseline_n,";
/// What the flat topics of a run begin with: the header and the facts. A record has no facts there.
pub const FLAT_MCAP: &[u8] = b"\x89MCAP0\r\n\x01\x0f\0\0\0\0\0\0\0\0\0\0\0\x07\0\0\0muprime\x0c";
/// The beginning and the mark of the table of a study.
pub const GATHERED: &[u8] = b"PAR1muprime.gathered/";

/// Bytes at the beginning and at the end of an earlier file in which its mark is looked for.
const HEAD: u64 = 1 << 16;

/// What the outputs of each kind begin with, and the mark of this program that they hold. The first line of
/// other texts is their kind, as the columns of a table are; of JSON, what is before its first comma.
const KINDS: [(&[u8], &[u8]); 9] = [
    (b"<!doctype html>", b"<title>muprime: "),
    (NEXT_PLAN, b""),
    (b"# muprime.law/", b""),
    (b"{\n  \"@context\"", b"\"#muprime\""),
    (b"PAR1", b"muprime.gathered/"),
    (b"PAR1", b"muprime.units"),
    (b"ARROW1", b"muprime.units"),
    (b"\x89HDF", b"muprime_version"),
    (FLAT_MCAP, b""),
];

/// What files of a format begin with, and the endings of their names; the last is that of all other texts.
const FORMATS: [(&[u8], &[&str]); 9] = [
    (b"<!doctype html>", &["html", "htm"]),
    (MODEL, &["toml"]),
    (NEXT_PLAN, &["toml"]),
    (b"{", &["json", "jsonl", "jsonld", "ndjson"]),
    (b"PAR1", &["parquet", "pq"]),
    (b"ARROW1", &["arrow", "feather"]),
    (b"\x89HDF", &["h5", "hdf5", "hdf", "nc"]),
    (b"\x89MCAP0", &["mcap"]),
    (b"", &["csv"]),
];
/// Endings of formats that are not written.
const NOT_WRITTEN: [&str; 9] = ["pdf", "xlsx", "xls", "ods", "tsv", "npz", "mat", "zip", "png"];

/// Writes a file that a person named as an output, as [`write_whole`] does, unless another file is there.
///
/// # Errors
/// As [`write_whole`] and [`replaceable`].
pub fn write_output(path: &Path, bytes: impl AsRef<[u8]>) -> miette::Result<()> {
    replaceable(path, bytes.as_ref())?;
    write_whole(path, bytes)
}

/// Whether an output may take the place of what has that name: nothing, an empty file, or an earlier output
/// of the same kind. `output` is all of it, or what its kind begins with.
///
/// # Errors
/// Another file is there, the name is that of a session's record in a run's folder, or its ending that of
/// another format.
pub fn replaceable(path: &Path, output: &[u8]) -> miette::Result<()> {
    if crate::run_dir::is_record(path) && path.with_file_name("run.toml").exists() {
        miette::bail!(
            help = "give another name",
            "{} is the name of a session's record in the folder of a run: nothing was replaced",
            path.display()
        );
    }
    let named = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_lowercase();
    let (_, endings) = FORMATS.iter().find(|(begins, _)| output.starts_with(begins)).expect("the last one");
    let mut others = FORMATS.iter().flat_map(|(_, endings)| *endings).chain(&NOT_WRITTEN);
    if !endings.contains(&&*named) && others.any(|other| **other == named) {
        let right = path.with_extension(endings[0]);
        miette::bail!(
            help = format!("name it {}", right.display()),
            "{}: this output is .{}, not .{named}",
            path.display(),
            endings[0]
        );
    }
    let plain = fs::metadata(path).is_ok_and(|there| there.is_file());
    let Some((head, tail)) = plain.then(|| ends_of(path)).and_then(Result::ok) else { return Ok(()) };
    if head.is_empty() || same_kind(&head, &tail, output) {
        return Ok(());
    }
    miette::bail!(
        help = "give a name that is free, or remove the file",
        "{} exists and is no earlier output of this kind: nothing was replaced",
        path.display()
    )
}

/// The beginning and the end of a file.
fn ends_of(path: &Path) -> std::io::Result<(Vec<u8>, Vec<u8>)> {
    let (mut file, mut head, mut tail) = (File::open(path)?, Vec::new(), Vec::new());
    file.by_ref().take(HEAD).read_to_end(&mut head)?;
    let length = file.metadata()?.len();
    file.seek(SeekFrom::Start(length.saturating_sub(HEAD)))?;
    file.take(HEAD).read_to_end(&mut tail)?;
    Ok((head, tail))
}

fn same_kind(head: &[u8], tail: &[u8], output: &[u8]) -> bool {
    let holds = |bytes: &[u8], mark: &[u8]| mark.is_empty() || bytes.windows(mark.len()).any(|w| w == mark);
    let kind = KINDS.iter().find(|(begins, mark)| output.starts_with(begins) && holds(output, mark));
    if let Some((begins, mark)) = kind {
        return head.starts_with(begins) && (holds(head, mark) || holds(tail, mark));
    }
    let end = if output.starts_with(b"{") { b',' } else { b'\n' };
    let first = output.iter().position(|b| *b == end).map_or(output, |at| &output[..=at]);
    first.len() > 2 && head.starts_with(first)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What a person wrote stays, also where it names this program; an output of the same kind is replaced.
    #[test]
    fn an_output_replaces_only_outputs_of_its_kind() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("mine");
        let table = b"point,time_s,mu_relative\n1,2,3\n".as_slice();
        let page = b"<!doctype html><html><title>muprime: new</title>".as_slice();
        let plan = [NEXT_PLAN, b"about = \"new\"\n"].concat();
        for (there, output, replaced) in [
            ("amplitude,force\n1,2\n", MODEL, false),
            ("# my notes\n", &*plan, false),
            ("#:schema ./plan.schema.json\n# `muprime schema plan`\nname = \"mine\"\n", &plan, false),
            ("# Written by muprime diagnose.\nname = \"mine\"\n", &plan, false),
            (std::str::from_utf8(NEXT_PLAN).unwrap(), &plan, true),
            ("import muprime\n", table, false),
            ("point,time_s,mine\n1,2,3\n", table, false),
            ("point,time_s,mu_relative\n", table, true),
            ("<!doctype html><p>my page on muprime", page, false),
            ("<!doctype html><title>muprime: old</title>", page, true),
            ("{\"schema\":\"muprime.verdict/1\",1", b"{\"schema\":\"muprime.cases/1\",2", false),
            ("{\"schema\":\"muprime.cases/1\",1", b"{\"schema\":\"muprime.cases/1\",2", true),
            ("PAR1 of others", GATHERED, false),
            ("PAR1 muprime.units", GATHERED, false),
            ("PAR1 muprime.gathered/1", GATHERED, true),
            ("\u{89}MCAP0\r\nmuprime", FLAT_MCAP, false),
            ("", MODEL, true),
        ] {
            fs::write(&path, there).unwrap();
            let written = write_output(&path, output);
            assert_eq!(written.is_ok(), replaced, "{there}");
            assert_eq!(fs::read(&path).unwrap(), if replaced { output } else { there.as_bytes() });
        }
    }

    /// The table of a study was Parquet under any name, as `report -o x.pdf` was a page.
    #[test]
    fn a_name_that_ends_as_another_format_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let table = b"point,time_s\n1,2\n".as_slice();
        for (name, output, right) in [
            ("all.csv", GATHERED, Some("all.parquet")),
            ("verdict.pdf", PAGE, Some("verdict.html")),
            ("model.json", MODEL, Some("model.toml")),
            ("points.XLSX", table, Some("points.csv")),
            ("points.tsv", table, Some("points.csv")),
            ("signals.csv", FLAT_MCAP, Some("signals.mcap")),
            ("cases.csv", b"{\"schema\":1,2}", Some("cases.json")),
            ("all.parquet", GATHERED, None),
            ("cases.JSONL", b"{\"schema\":1,2}", None),
            ("spectrum.txt", table, None),
            ("x.2026-11-30", table, None),
            ("page", PAGE, None),
        ] {
            let path = folder.path().join(name);
            let refused = write_output(&path, output).err();
            assert_eq!(refused.is_some(), right.is_some(), "{name}");
            assert_eq!(path.exists(), right.is_none(), "{name}");
            if let (Some(why), Some(right)) = (refused, right) {
                assert!(why.help().unwrap().to_string().ends_with(right), "{name}: {why}");
            }
        }
    }

    #[test]
    fn the_name_of_a_record_is_never_an_output_in_the_folder_of_a_run() {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("run.toml"), "").unwrap();
        let record = folder.path().join("run-1.mcap");
        assert!(replaceable(&record, FLAT_MCAP).is_err(), "it would be taken for a session's record");
        fs::write(&record, "").unwrap();
        assert!(write_output(&record, PAGE).unwrap_err().to_string().contains("session's record"));
        assert!(replaceable(&folder.path().join("signals.mcap"), FLAT_MCAP).is_ok());
    }
}
