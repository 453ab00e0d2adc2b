//! What a profile cannot mean is refused with its place; nothing in it is ignored.

use muprime_instruments::{Profile, ProfileError};

const RTU: &str = include_str!("../../drivers/profiles/robotiq-ft300.toml");
const STREAM: &str = include_str!("../../drivers/profiles/robotiq-ft300-stream.toml");
const AMPLIFIER: &str = include_str!("../../drivers/profiles/muprime-amplifier.toml");
const STAGE: &str = include_str!("../../drivers/profiles/muprime-stage.toml");
const CAN: &str = include_str!("../../drivers/profiles/ati-netft-can.toml");
const LINES: &str = include_str!("../../drivers/profiles/piezodrive-pdus210.toml");
const SCPI: &str = include_str!("../../drivers/profiles/keysight-33500b.toml");
const RELAY: &str = include_str!("../../drivers/profiles/muprime-relay.toml");
const DRIVE: &str = include_str!("../../drivers/profiles/cia402-profile-velocity.toml");
const DBC: &str = include_str!("../../drivers/profiles/muprime-can.dbc");

fn read(text: &str, dbc: &str) -> Result<(), ProfileError> {
    let profile = Profile::parse_with(text, &|name| (name == "muprime-can.dbc").then(|| dbc.to_string()))?;
    profile.check(text)
}

/// The text with its first `from` replaced; the change must be one.
fn changed(text: &str, from: &str, to: &str) -> String {
    assert!(text.contains(from), "`{from}` is not there");
    text.replacen(from, to, 1)
}

#[test]
fn each_wrong_profile_is_refused_with_place_and_cause() {
    for good in [RTU, STREAM, AMPLIFIER, STAGE, CAN, LINES, SCPI] {
        read(good, DBC).unwrap();
    }
    let extra = |text: &str, more: &str| format!("{text}\n{more}\n");
    let wrong = [
        (
            "a stream on a line of text",
            changed(STREAM, "kind = \"modbus_rtu\"", "kind = \"serial\""),
            "[[poll]]",
        ),
        (
            "a stream over TCP",
            extra(AMPLIFIER, "[stream]\nrate_hz = 9\nlength = 9\ncheck = \"sum8\""),
            "[stream]",
        ),
        ("a drive that does not say whether it is on", AMPLIFIER.replace("output_on", "lamp"), "`output_on`"),
        (
            "a drive that takes no amplitude",
            AMPLIFIER
                .replace("\"amplitude\"", "\"size\"")
                .replace("\namplitude =", "\nsize =")
                .replace(" amplitude =", " size ="),
            "`amplitude`",
        ),
        (
            "a drive without an off",
            changed(AMPLIFIER, "name = \"enable\"", "name = \"enable\"\n#")
                .replace("safe = 0.0\necho = \"output_on\"", "echo = \"output_on\""),
            "`safe`",
        ),
        (
            "a stage that takes no velocity",
            STAGE.replacen("[[set]]\nname = \"velocity\"", "[[set]]\nname = \"speed\"", 1),
            "`velocity`",
        ),
        (
            "a counter of messages that is none",
            changed(CAN, "sequence = \"sample\"", "sequence = \"sampel\""),
            "`sampel`",
        ),
        (
            "a counter of a stream that is none",
            changed(STREAM, "length = 16", "length = 16\nsequence = \"nr\""),
            "`nr`",
        ),
        ("a serial format", changed(RTU, "\"8N1\"", "\"9X7\""), "9X7"),
        (
            "no time to answer",
            changed(RTU, "response_timeout_ms = 200", "response_timeout_ms = 0"),
            "above zero",
        ),
        (
            "an 'off' that is sent again after 5 s",
            changed(AMPLIFIER, "response_timeout_ms = 50", "response_timeout_ms = 5000"),
            "at most 2000",
        ),
        ("no baud", changed(RTU, "baud = 19200", "baud = 0"), "no bits"),
        (
            "polls on a CAN bus",
            extra(CAN, "[[poll]]\nname = \"p\"\naddress = 1\ncount = 1\nrate_hz = 1"),
            "[[poll]]",
        ),
        ("set-points by plain CAN", extra(CAN, "[[set]]\nname = \"load\"\nsend = \"x\""), "[[set]]"),
        (
            "a query of registers",
            extra(RTU, "[[query]]\nname = \"q\"\nsend = \"q?\"\nrate_hz = 1"),
            "[[query]]",
        ),
        ("a line of text at connection over Modbus", extra(AMPLIFIER, "[[init]]\nsend = \"*RST\""), "`send`"),
        (
            "a function of the maker's own over TCP",
            extra(AMPLIFIER, "[[init]]\nfunction = [70, 1]"),
            "`function`",
        ),
        ("an init that does nothing", extra(AMPLIFIER, "[[init]]\ntext = \"nothing\""), "one thing"),
        (
            "a DBC file for registers",
            changed(RTU, "kind = \"modbus_rtu\"", "kind = \"modbus_rtu\"\ndbc = \"muprime-can.dbc\""),
            "`dbc`",
        ),
        (
            "alarms of registers",
            changed(RTU, "kind = \"modbus_rtu\"", "kind = \"modbus_rtu\"\nunsolicited = [\"ERR\"]"),
            "unsolicited",
        ),
        ("an alarm that any line could be", changed(LINES, "\"LPERR\"", "\"{code} LPERR\""), "must begin"),
        ("a set-point without its line", changed(SCPI, "send = \"SOUR1:VOLT {}\"", ""), "`send`"),
        (
            "a set-point's line without its value",
            changed(SCPI, "SOUR1:VOLT {}", "SOUR1:VOLT {frequency}"),
            "own value",
        ),
        ("a brace alone", changed(SCPI, "SOUR1:VOLT {}", "SOUR1:VOLT {"), "brace"),
        (
            "a register in a line of text",
            changed(SCPI, "frame = \"voltage\"", "frame = \"voltage\"\nregister = 1"),
            "line of text",
        ),
        (
            "an answer with a number that is nobody's",
            changed(
                SCPI,
                "send = \"SOUR1:VOLT?\"",
                "send = \"SOUR1:VOLT?\"\nanswer = \"{echo_amplitude} {x}\"",
            ),
            "`{x}`",
        ),
        ("a query without an end of its rate", changed(SCPI, "rate_hz = 20", "rate_hz = 0"), "rate_hz"),
        ("a stream without a check", changed(STREAM, "check = \"crc16-modbus\"", ""), "check"),
        ("a check that is none", changed(STREAM, "crc16-modbus", "CRC-16/MOBDUS"), "CRC-16/MODBUS"),
        ("a stream that nothing stops", changed(STREAM, "stop = [0xFF, 50]", ""), "`stop`"),
        ("polls beside a stream", changed(STREAM, "once = true", "rate_hz = 1"), "polled"),
        (
            "a resolution of nothing",
            changed(RTU, "type = \"i16\"", "type = \"i16\"\nresolution_si = 0.0"),
            "resolution_si",
        ),
        ("a noise below zero", changed(RTU, "type = \"i16\"", "type = \"i16\"\nnoise = -1.0"), "`noise`"),
        ("a bit that is a float", changed(RELAY, "type = \"u16\"", "type = \"f32\""), "its type is `u16`"),
        ("an identifier of 30 bits", extra(CAN, "[[init]]\ncan = [0x20000000, [1]]"), "29 bits"),
        ("a request of nine bytes", changed(CAN, "[0x02]", "[2, 0, 0, 0, 0, 0, 0, 0, 0]"), "8 bytes"),
        ("an identifier beyond CANopen's", changed(DRIVE, "cob = 0x180", "cob = 0x781"), "0x780"),
        ("an id with a path in it", changed(RTU, "id = \"robotiq-ft300\"", "id = \"../ft300\""), "not an id"),
        (
            "a file elsewhere",
            changed(CAN, "dbc = \"muprime-can.dbc\"", "dbc = \"../muprime-can.dbc\""),
            "beside",
        ),
    ];
    for (what, text, cause) in wrong {
        let said = match read(&text, DBC) {
            Ok(()) => panic!("{what}: taken"),
            Err(error) => error.to_string(),
        };
        assert!(said.contains(cause), "{what}: {said}");
        assert!(said.starts_with("line "), "{what} has no place: {said}");
    }
}

#[test]
fn every_frame_needs_a_golden_vector() {
    let at = STREAM.find("[[vector]]\nframe = \"stream\"").unwrap();
    let end = STREAM[at + 1..].find("[[vector]]").map_or(STREAM.len(), |next| at + 1 + next);
    let without = format!("{}{}", &STREAM[..at], &STREAM[end..]);
    let said = read(&without, DBC).unwrap_err().to_string();
    assert!(said.contains("`stream` has no golden vector"), "{said}");
}

#[test]
fn what_a_dbc_file_says_beyond_plain_signals_is_read_or_refused() {
    let said = |dbc: &str| read(CAN, dbc).map_err(|error| error.to_string());
    let fx = DBC.lines().find(|line| line.contains("SG_ Fx ")).unwrap();
    let multiplexed = said(&changed(DBC, fx, &changed(fx, "SG_ Fx ", "SG_ Fx m1 "))).unwrap_err();
    assert!(multiplexed.contains("multiplexed"), "{multiplexed}");
    let id = DBC.lines().find(|line| line.starts_with("BO_") && line.contains("NETFT_Short1")).unwrap();
    let id: u32 = id.split_whitespace().nth(1).unwrap().parse().unwrap();
    let float = said(&format!("{DBC}\nSIG_VALTYPE_ {id} Fx : 1;\n")).unwrap_err();
    assert!(float.contains("float of 16 bits"), "{float}");
}

/// Several set-points in one line, hexadecimal, and the emulator's ear for them.
#[test]
fn a_line_carries_several_set_points() {
    let text = changed(SCPI, "SOUR1:FREQ {}", "APPL {},{amplitude:.2},{enable:04X}");
    let profile = Profile::parse(&text).unwrap();
    let set = |name: &str| profile.set(name).unwrap();
    let newest = |other| if other == set("amplitude") { 1.25 } else { 1.0 };
    let (line, answer) = profile.line(set("frequency"), 27_500.5, &newest).unwrap();
    assert_eq!((line.as_str(), answer), ("APPL 27500.500,1.25,0001", None));
    let heard = profile.heard(set("frequency"), &line).unwrap();
    assert_eq!(heard, [(set("frequency"), 27_500.5), (set("amplitude"), 1.25), (set("enable"), 1.0)]);
    assert_eq!(profile.heard(set("frequency"), "APPL 27500.5"), None);
    assert_eq!(profile.heard(set("enable"), "OUTP1 1"), Some(vec![(set("enable"), 1.0)]));
    assert_eq!(profile.line(set("enable"), 0.0, &newest).unwrap().0, "OUTP1 0");
}

/// A float's type says nothing of its resolution, a DBC signal's factor does.
#[test]
fn a_resolution_is_stated_or_known_or_unknown() {
    let lsb = |text: &str, signal: &str, dbc: &str| {
        let profile = Profile::parse_with(text, &|_| Some(dbc.to_string())).unwrap();
        profile.lsb_si(profile.signal(signal).unwrap(), &profile.values())
    };
    assert_eq!(lsb(RTU, "fx", DBC), 0.01, "a count of a whole number");
    let float = RTU.replacen("register = 0\ntype = \"i16\"", "register = 0\ntype = \"f32\"", 1);
    // What shares its bytes is a part of them.
    let float =
        float.replacen("register = 1\ntype = \"i16\"", "register = 1\ntype = \"i16\"\nbits = [0, 16]", 1);
    assert!(lsb(&float, "fx", DBC).is_nan());
    let stated = float.replacen("type = \"f32\"", "type = \"f32\"\nresolution_si = 1e-4", 1);
    assert_eq!(lsb(&stated, "fx", DBC), 1e-4);
    let fx = DBC.lines().find(|line| line.contains("SG_ Fx ")).unwrap();
    let factor = DBC.replacen(fx, &fx.replacen("(1,", "(0.001,", 1), 1);
    let (one, thousandth) = (lsb(CAN, "fx", DBC), lsb(CAN, "fx", &factor));
    assert!((thousandth / one - 1e-3).abs() < 1e-12, "{thousandth} {one}");
}

const SCATTERED: &str = include_str!("../../drivers/profiles/labjack-t7.toml");
const DATAGRAMS: &str = include_str!("../../drivers/profiles/ati-netft-rdt.toml");

/// Registers that lie apart are read in as few reads as the profile permits, and never a number in two.
#[test]
fn scattered_registers_are_read_in_as_few_reads_as_may_be() {
    let spans = |text: &str| {
        let profile = Profile::parse(text).unwrap_or_else(|error| panic!("{error}"));
        let frame = profile.frame("sample").unwrap();
        profile.frames()[frame.0].spans.iter().map(|s| (s.address, s.count)).collect::<Vec<_>>()
    };
    assert_eq!(spans(SCATTERED), [(0, 2), (4, 2)]);
    assert_eq!(spans(&changed(SCATTERED, "rate_hz = 250", "rate_hz = 250\ngap = 1")), [(0, 2), (4, 2)]);
    let joined = changed(SCATTERED, "rate_hz = 250", "rate_hz = 250\ngap = 2");
    assert_eq!(spans(&joined), [(0, 6)]);
    let third = |address: u32, number: &str| {
        format!(
            "{joined}\n[[signal]]\nname = \"third\"\nframe = \"sample\"\naddress = {address}\ntype = \"{number}\"\nbits = [0, 16]\n"
        )
    };
    assert_eq!(spans(&third(1, "u16")), [(0, 6)], "within another");
    assert_eq!(spans(&third(5, "f64")), [(0, 9)], "over the end of another");
    assert_eq!(spans(&third(9, "u16")), [(0, 6), (9, 1)]);
    let far = changed(&third(124, "f32"), "gap = 2", "gap = 1000");
    assert_eq!(spans(&far), [(0, 6), (124, 2)], "one read takes 125, and a number is never parted");
    let past = Profile::parse(&third(65535, "f32")).unwrap_err().to_string();
    assert!(past.contains("65535") && past.starts_with("line "), "{past}");
}

#[test]
fn what_datagrams_multiplexors_and_scattered_registers_cannot_be_is_refused() {
    let mux = "BO_ 5 Mux: 8 RIG\n SG_ M M : 0|8@1+ (1,0) [0|0] \"\" RIG\n SG_ P m1 : 8|16@1- (1,0) [0|0] \"\" RIG\n \
               SG_ Q m2 : 8|16@1- (1,0) [0|0] \"\" RIG\n";
    let can = |multiplex: &str| {
        format!(
            "[profile]\nschema = 1\nid = \"a\"\nmaker = \"m\"\nmodels = [\"m\"]\nroles = [\"force.normal\"]\n\
             provenance = \"p\"\nverified = \"emulator-only\"\n[link]\nkind = \"can\"\ndbc = \"mux.dbc\"\n\
             [[message]]\nname = \"one\"\nreplies = [\"Mux\"]\nrate_hz = 100\n{multiplex}\n\
             [[signal]]\nname = \"normal\"\ndbc = \"Mux.P\"\n\
             [[vector]]\nhex = \"0105000000000000\"\nexpect = {{ normal = 5 }}\n"
        )
    };
    let parse = |text: &str, dbc: &str| Profile::parse_with(text, &|_| Some(dbc.to_string()));
    let good = parse(&can("multiplex = 1"), mux).unwrap_or_else(|error| panic!("{error}"));
    good.check(&can("multiplex = 1")).unwrap();
    // The emulator says which message it is.
    let (frame, normal) = (good.frame("one").unwrap(), good.signal("normal").unwrap());
    let mut bytes = vec![0; 8];
    good.encode(frame, &mut bytes, &mut |signal| (signal == normal).then_some(5.0));
    assert_eq!(bytes, [1, 5, 0, 0, 0, 0, 0, 0]);
    let muprime_instruments::profile::FrameKind::Messages(_, parts) = &good.frames()[0].kind else {
        panic!()
    };
    assert!(
        parts[0].selects(&bytes)
            && !parts[0].selects(&[2, 5, 0, 0, 0, 0, 0, 0])
            && !parts[0].selects(&[1, 5])
    );
    let nested = format!("{mux}\nSG_MUL_VAL_ 5 P M 1-3;\n");
    let wrong = [
        ("a multiplexed signal where it is not", can(""), mux, "multiplex = 1"),
        ("the other of the multiplexor's values", can("multiplex = 2"), mux, "multiplex = 1"),
        ("a value that its multiplexor cannot have", can("multiplex = 300"), mux, "8 bits"),
        ("ranges of a multiplexor", can("multiplex = 1"), nested.as_str(), "SG_MUL_VAL_"),
        (
            "no multiplexor at all",
            can("multiplex = 1"),
            &mux.replace("M M :", "M :").replace(" m1", "").replace(" m2", ""),
            "no",
        ),
        (
            "datagrams to nobody",
            changed(DATAGRAMS, "[[init]]\nhex = \"1234 0002 00000000\"", ""),
            "",
            "local_port",
        ),
        (
            "a question in datagrams",
            format!("{DATAGRAMS}\n[[query]]\nname = \"q\"\nsend = \"q?\"\nrate_hz = 1\n"),
            "",
            "[[query]]",
        ),
        ("bytes that are none", changed(DATAGRAMS, "1234 0002 00000000", "12 3"), "", "hexadecimal"),
        ("a stream over TCP without a check", changed(DATAGRAMS, "\"udp\"", "\"tcp\""), "", "check"),
        (
            "a port of this machine over TCP",
            changed(DATAGRAMS, "kind = \"udp\"", "kind = \"tcp\"\nlocal_port = 5"),
            "",
            "local_port",
        ),
        ("a poll of nothing", changed(SCATTERED, "address = 60000", "register = 0"), "", "`address`"),
        ("half a place", changed(SCATTERED, "once = true", "once = true\naddress = 60000"), "", "both"),
        (
            "a gap in neighbours",
            changed(SCATTERED, "once = true", "once = true\naddress = 60000\ncount = 2\ngap = 3"),
            "",
            "`gap`",
        ),
        ("two places", changed(SCATTERED, "address = 4", "address = 4\nregister = 2"), "", "takes the place"),
        (
            "reads that look alike over RTU",
            changed(
                &SCATTERED.replace("port = 502\n", ""),
                "kind = \"modbus_tcp\"",
                "kind = \"modbus_rtu\"\nbaud = 19200\nformat = \"8N1\"",
            ),
            "",
            "same number",
        ),
    ];
    for (what, text, dbc, cause) in wrong {
        let said = match parse(&text, dbc) {
            Ok(_) => panic!("{what}: taken"),
            Err(error) => error.to_string(),
        };
        assert!(said.contains(cause), "{what}: {said}");
        assert!(said.starts_with("line "), "{what} has no place: {said}");
    }
}

const CHAMBER: &str = include_str!("../../drivers/profiles/muprime-chamber.toml");
const DECODERS: &str = include_str!("../../drivers/profiles/polytec-ofv5000.toml");
const BOARD: &str = include_str!("../../docs/profiles/bench-board.toml");
const EDS: &str = include_str!("../../drivers/profiles/cia402-profile-velocity.eds");

/// A status bit of a sensor on CAN was on the wire and never seen: `bits` beside `dbc` was not read.
#[test]
fn bits_of_a_dbc_signal_are_read() {
    let text = include_str!("../../docs/profiles/can-force.toml");
    let dbc = include_str!("../../docs/profiles/can-force.dbc");
    let of = |bits: &str, dbc: &str| {
        let signal =
            format!("name = \"part\"\ndbc = \"Force.Status\"\n{bits}\n\n[[signal]]\nname = \"status\"");
        Profile::parse_with(&changed(text, "name = \"status\"", &signal), &|_| Some(dbc.to_string()))
    };
    for (bits, status, value) in [
        ("bits = [1, 1]", 0x02, 1.0),
        ("bits = [1, 1]", 0xFD, 0.0),
        ("bits = [4, 4]", 0xA5, 10.0),
        ("bits = [0, 8]", 0xA5, 165.0),
    ] {
        let profile = of(bits, dbc).unwrap_or_else(|error| panic!("{error}"));
        let mut values = profile.values();
        let mut frame = [0x07, 0xD0, 0xFE, 0x0C, status, 0x2A];
        profile.decode(profile.frame("force").unwrap(), &frame, &mut values).unwrap();
        assert_eq!(values.get(profile.signal("part").unwrap()), value, "{bits} of {status:#x}");
        // What is encoded over other bytes leaves the other bits alone.
        frame[4] = !status;
        let part = profile.signal("part").unwrap();
        let mut set = |signal| (signal == part).then_some(value);
        profile.encode(profile.frame("force").unwrap(), &mut frame, &mut set);
        profile.decode(profile.frame("force").unwrap(), &frame, &mut values).unwrap();
        assert_eq!(values.get(part), value, "{bits} encoded");
    }
    let scaled = dbc.lines().find(|line| line.contains("SG_ Status ")).unwrap();
    let scaled = changed(dbc, scaled, &scaled.replacen("(1,0)", "(2,0)", 1));
    for (what, bits, dbc) in [
        ("beyond its end", "bits = [7, 2]", dbc),
        ("none", "bits = [0, 0]", dbc),
        ("of a scaled number", "bits = [1, 1]", &scaled),
    ] {
        let said = of(bits, dbc).expect_err(what).to_string();
        assert!(said.starts_with("line ") && said.contains("`bits` of signal `part`"), "{what}: {said}");
    }
}

#[test]
fn bits_of_an_object_are_read() {
    let fault = "name = \"fault\"\nobject = [0x6041, 0]\nbits = [3, 1]\n\n[[signal]]\nname = \"velocity\"";
    let text = changed(DRIVE, "name = \"velocity\"", fault);
    let profile = Profile::parse_with(&text, &|_| Some(EDS.to_string())).unwrap_or_else(|e| panic!("{e}"));
    let mut values = profile.values();
    for (status, value) in [(0x37, 0.0), (0x08, 1.0)] {
        let frame = profile.frame("actual").unwrap();
        profile.decode(frame, &[status, 2, 0, 0, 0, 0, 0, 0], &mut values).unwrap();
        assert_eq!(values.get(profile.signal("fault").unwrap()), value);
    }
}

/// A key that nothing reads is refused at its place: behind a line of a good profile each of these is one.
#[test]
fn a_key_that_nothing_reads_is_refused() {
    let init = "[[init]]\ntext = \"\"\n";
    let wrong = [
        (RTU, "[link]", "port = 502"),
        (RTU, "[link]", "connect_timeout_ms = 100"),
        (RTU, "[link]", "min_gap_ms = 2"),
        (RTU, "[link]", "rx_terminator = \"\\n\""),
        (AMPLIFIER, "[link]", "bitrate = 500000"),
        (AMPLIFIER, "[link]", "tx_terminator = \"\\r\""),
        (AMPLIFIER, "[link]", "node = 3"),
        (CAN, "[link]", "unit = 1"),
        (CAN, "[link]", "baud = 9600"),
        (CAN, "[link]", "heartbeat_ms = 100"),
        (DRIVE, "[link]", "base = 1"),
        (DATAGRAMS, "[link]", "connect_timeout_ms = 100"),
        (BOARD, "[link]", "rx_terminator = \"\\n\""),
        (BOARD, "[link]", "unsolicited = [\"ALARM\"]"),
        (BOARD, "[link]", "error_query = { send = \"ERR?\", ok = [\"0\"] }"),
        (LINES, "[link]", "choice = { ask = \"NAME {which}\", most = 2 }"),
        (DECODERS, "[link]", "min_gap_ms = 5"),
        (DECODERS, "[link]", "backoff_first_ms = 5"),
        (CHAMBER, "[[poll]]", "sequence = \"magic\""),
        (CHAMBER, "[[write]]", "rate_hz = 5"),
        (CHAMBER, "[[set]]", "safe = 101325.0"),
        (BOARD, "[stream]", "settle_ms = 5"),
        (BOARD, "[stream]", "start_register = [1, 1]"),
        (STREAM, "start_register = [410, 0x0200]", "start_function = [70, 1]"),
        (DATAGRAMS, "[stream]", "believed_after = 2"),
        (CAN, "[[message]]", "length = 8"),
        (CAN, "[[message]]", "cob = 5"),
        (DRIVE, "[[message]]", "request = [1]"),
        (DRIVE, "[[message]]", "multiplex = 1"),
        (SCPI, "[[query]]", "unit = \"V\"\nlength = 3"),
        (DRIVE, "[[write]]", "address = 5"),
        (AMPLIFIER, "[[write]]", "cob = 5"),
        (CAN, "[[signal]]", "byte_order = \"DCBA\""),
        (CAN, "[[signal]]", "type = \"f32\""),
        (CAN, "[[signal]]", "register = 7"),
        (CAN, "[[signal]]", "array = 2"),
        (DRIVE, "[[signal]]", "type = \"f32\""),
        (DRIVE, "[[signal]]", "byte = 4"),
        (AMPLIFIER, "[[signal]]", "value = \"1\"\nbits = [0, 1]"),
        (AMPLIFIER, "[[signal]]", "value = \"1\"\nscale_expr = \"2\""),
        (AMPLIFIER, "[[signal]]", "object = [1, 1]"),
        (SCPI, "[[set]]", "register = 4"),
        (SCPI, "[[set]]", "byte_order = \"DCBA\""),
        (AMPLIFIER, "[[set]]", "send_zero = \"x\""),
        (DRIVE, "[[set]]", "type = \"f32\""),
        (RTU, "[emulator]", "names = [\"a\"]"),
        (SCPI, "[[vector]]", "hex = \"00\""),
        (AMPLIFIER, init, "copy = [1, 2, 3]\ntable = \"coil\""),
        (CHAMBER, init, "registers = [1, [1]]"),
        (DATAGRAMS, init, "send = \"x\"\nexpect = [\"y\"]"),
        (SCPI, init, "hex = \"00\""),
    ];
    for (text, section, keys) in wrong {
        let line = format!("{section}\n{keys}\n");
        let text = match text.contains(&format!("{section}\n")) {
            true => text.replacen(&format!("{section}\n"), &line, 1),
            false => format!("{text}\n{line}"),
        };
        let said = read(&text, DBC).expect_err(keys).to_string();
        assert!(said.contains(" is not read ") && said.starts_with("line "), "{section} {keys}: {said}");
    }
}

/// What a role or a clock would leave unread.
#[test]
fn a_value_that_its_role_does_not_judge_is_refused() {
    let marked = changed(STAGE, "name = \"position\"", "name = \"position\"\nvalid_when = \"velocity < 1\"");
    for (what, text, cause) in [
        ("a validity that a stage does not read", marked, "`valid_when`"),
        (
            "a clock that nobody reads",
            changed(STAGE, "stamp = \"device\"", "stamp = \"arrival\""),
            "device_time",
        ),
        ("a clock that is not there", changed(STAGE, "device_time = \"time\"", ""), "device_time"),
        (
            "a byte order in a line",
            changed(SCPI, "[[signal]]", "[[signal]]\nbyte_order = \"DCBA\""),
            "byte order",
        ),
        (
            "a chamber on a serial line",
            CHAMBER
                .replace("modbus_tcp\"", "modbus_rtu\"\nbaud = 9600\nformat = \"8N1\"")
                .replace("port = 1502\n", "")
                .replace("connect_timeout_ms = 1000\n", ""),
            "ModbusTcp",
        ),
    ] {
        let said = read(&text, DBC).expect_err(what).to_string();
        assert!(said.contains(cause) && said.starts_with("line "), "{what}: {said}");
    }
}

/// The driver of CANopen commands a drive of CiA 402; `check` approved an amplifier that it could not drive.
#[test]
fn a_canopen_profile_that_the_driver_cannot_drive_is_refused() {
    let parse = |text: &str| Profile::parse_with(text, &|_| Some(EDS.to_string()));
    parse(DRIVE).unwrap_or_else(|error| panic!("{error}"));
    let at = DRIVE.find("[[set]]\nname = \"control\"").unwrap();
    let end = at + DRIVE[at..].find("\n\n").unwrap();
    let second = "[[message]]\nname = \"more\"\ncob = 0x180\nlength = 8\nrate_hz = 9\n\n[[signal]]\nframe = \"actual\"";
    for (what, text, cause) in [
        (
            "an amplifier",
            changed(DRIVE, "\"motion.slide\"", "\"motion.slide\", \"force.lateral\""),
            "`motion.slide`",
        ),
        ("no status", DRIVE.replace("statusword", "state"), "`statusword`"),
        ("no control word", format!("{}{}", &DRIVE[..at], &DRIVE[end..]), "`control`"),
        (
            "two messages",
            changed(
                &DRIVE
                    .replace("object = [0x2", "frame = \"actual\"\nobject = [0x2")
                    .replace("object = [0x6064", "frame = \"actual\"\nobject = [0x6064"),
                "[[signal]]",
                second,
            ),
            "one [[message]]",
        ),
    ] {
        let said = parse(&text).expect_err(what).to_string();
        assert!(
            said.contains("CiA 402") && said.contains(cause) && said.starts_with("line "),
            "{what}: {said}"
        );
    }
}
