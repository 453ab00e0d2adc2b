//! DBC files and data sheets as cantools and python-canopen decode them.

use instruments::codec::encoding::decoded;
use instruments::codec::from_hex;
use instruments::codec::{dbc, eds};
use tests::{documents, file, python};

#[test]
fn buses_are_described_as_cantools_and_python_canopen_read_them() {
    let folder = tempfile::tempdir().unwrap();
    let told =
        documents(&python().arg(file("tests/peers/bus_dialects.py")).arg(folder.path()).output().unwrap());
    let (mut compared, mut refused, mut sheets) = (0, Vec::new(), 0);
    for one in &told {
        let path = one["file"].as_str().unwrap();
        let text = decoded(&std::fs::read(path).unwrap()).unwrap();
        if let Some(frame) = one["hex"].as_str() {
            let messages = match dbc::parse(&text) {
                Ok(messages) => messages,
                Err(why) => {
                    refused.push(format!("{path}: {why}"));
                    continue;
                }
            };
            let message = messages.get(one["message"].as_str().unwrap()).filter(|m| m.fault.is_none());
            let Some(message) = message else {
                // cantools lists the editor's store as well.
                if !one["message"].as_str().unwrap().starts_with("VECTOR") {
                    refused.push(format!("{path}: {}", one["message"]));
                }
                continue;
            };
            assert_eq!(Some(u64::from(message.id)), one["id"].as_u64(), "{one}");
            assert_eq!(Some(message.extended), one["extended"].as_bool(), "{one}");
            let frame = from_hex(frame).unwrap();
            for (name, value) in one["values"].as_object().unwrap() {
                let (ours, theirs) = (message.signals[name].read(&frame).unwrap(), value.as_f64().unwrap());
                assert!((ours - theirs).abs() <= 1e-12 * theirs.abs().max(1e-9), "{one}: {name} is {ours}");
                compared += 1;
            }
        } else {
            let entries = one["entries"].as_array().unwrap();
            let objects = eds::parse(&text).unwrap_or_else(|why| panic!("{path}: {why}"));
            let mapped = eds::mapping(&objects, 0x1800, 0x180);
            let cob = one["cob"].as_u64().unwrap();
            if cob & 0x8000_0000 != 0 {
                assert!(mapped.unwrap_err().to_string().contains("off"), "{path}");
                continue;
            }
            assert_eq!(cob & 0x7FF, 0x185, "{one}");
            let keys: Vec<u64> = mapped
                .unwrap_or_else(|why| panic!("{path}: {why}"))
                .0
                .iter()
                .map(|((i, s), _)| u64::from(*i) << 8 | u64::from(*s))
                .collect();
            let theirs: Vec<u64> = entries.iter().map(|e| e.as_u64().unwrap() >> 8).collect();
            assert_eq!(keys, theirs, "{one}");
            sheets += 1;
        }
    }
    println!("{compared} values of DBC files and {sheets} data sheets compared; refused: {refused:?}");
    assert!(
        compared > 600 && sheets >= 18 && refused.len() * 20 <= compared,
        "{compared} {sheets} {refused:?}"
    );
}
