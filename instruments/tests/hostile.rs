//! Every decoder against bytes that nobody sound would send: no panic, no hang, no endless growth.
//! Sound frames with a few bytes changed reach further than noise does, so both are tried.

use muprime_instruments::codec::{can, canopen, checksum::Check, dbc, modbus_rtu, stream, text};
use muprime_instruments::{Profile, codec};
use proptest::prelude::*;

/// Sound frames to start from.
fn sound() -> Vec<Vec<u8>> {
    vec![
        modbus_rtu::read(9, 3, 180, 6).bytes,
        modbus_rtu::write(9, 410, &[1, 2, 3]).bytes,
        modbus_rtu::give(9, 3, &[1, 2, 3, 4, 5, 6]),
        modbus_rtu::refuse(9, 3, 2),
        b"t1B4102\rT012345678\x30102030405060708\rz\r\x07".to_vec(),
        codec::from_hex("204e96003cf6d2040a00ecff1e0082ad").unwrap(),
        canopen::sdo_write(5, 0x60FF, 0, 4, -1).data().to_vec(),
        b"+2.750000000000000E+04\r\n".to_vec(),
    ]
}

fn bytes() -> impl Strategy<Value = Vec<u8>> {
    let noise = prop::collection::vec(any::<u8>(), 0..300);
    let damaged = (
        prop::sample::select(sound()),
        prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..4),
    )
        .prop_map(|(mut frame, changes)| {
            for (place, byte) in changes {
                let at = place.index(frame.len());
                frame[at] = byte;
            }
            frame
        });
    prop_oneof![noise, damaged]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 20_000, ..ProptestConfig::default() })]

    #[test]
    fn wires(bytes in bytes()) {
        let request = modbus_rtu::read(9, 3, 180, 6);
        let _ = modbus_rtu::answer_length(&request, &bytes);
        let _ = modbus_rtu::registers(&request, &bytes);
        let _ = modbus_rtu::written(&modbus_rtu::write(9, 410, &[1]), &bytes);
        let _ = modbus_rtu::hear(&bytes, &[0x46, 0x6A]);
        for (sync, length, check) in [(vec![0x20, 0x4E], 16, Check::CRC_16_MODBUS), (vec![], 13, Check::Sum7WithErrorBit)] {
            let mut cutter = stream::Cutter::new(stream::FrameShape { sync, length, check, check_from: 0, check_high_first: None, believed_after: 2 });
            let mut frames = 0;
            cutter.push(&bytes, |_| frames += 1);
            prop_assert!(frames * length <= bytes.len());
        }
        let mut said = 0;
        can::SlcanReader::default().push(&bytes, |_| said += 1);
        prop_assert!(said <= bytes.len());
        if let Some(frame) = can::CanFrame::new(0x585, &bytes[..bytes.len().min(8)]) {
            let _ = canopen::sdo_answer(&frame, 5, 0x6041, 0);
            let _ = canopen::sdo_request(&frame, 5);
        }
        let _ = text::number(&String::from_utf8_lossy(&bytes));
    }

    #[test]
    fn files(text in "(\\[profile\\]|\\[link\\]|[a-z_]{1,9} = |[0-9]{1,4}|\"[a-z]{0,5}\"|\n|BO_ 1 A: 8 B\n|SG_ S : 7\\|16@0\\+ \\(1,0\\) \\[0\\|0\\] \"\" R\n|[ -~]){0,40}") {
        let _ = Profile::parse(&text);
        let _ = dbc::parse(&text);
    }

    /// What a line holds is a finite number or none, whatever the line and the pattern are.
    #[test]
    fn lines(text in "(\\{a\\}|\\{b:x\\}|\\{c:.2\\}|\\{d:ON\\|OFF\\}|\\{\\*\\}|\\{\\{|[ -~µ]){0,12}", line in "[ -~µ\r]{0,40}") {
        if let Ok(pattern) = muprime_instruments::codec::pattern::Pattern::parse(&text) {
            let count = pattern.fields().count();
            let own = pattern.write(&[12.5; 4], 3);
            for line in [line, own] {
                if let Some(values) = pattern.read(&line) {
                    prop_assert!(values.len() == count && values.iter().all(|value| value.is_finite()));
                }
            }
        }
    }

    #[test]
    fn conditions(text in "[a-c0-9 &|=<>!()+*/x.-]{0,60}") {
        if let Ok(expression) = muprime_instruments::expression::Expression::compile(&text, &|name| (name == "a").then_some(0)) {
            let _ = expression.value(&[f64::NAN]);
            let _ = expression.holds(&[1e300]);
        }
    }
}
