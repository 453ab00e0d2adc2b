//! 'Off' over TCP on this machine: an instrument that refuses a part of it, and one whose connection is lost.

use super::*;
use crate::endpoint::Endpoint;
use crate::endpoint::tests::{DriveSetPoint, on, state};
use crate::link_error::Closed;
use crate::ports::AmplifierPort;
use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel, sync_channel};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::Instant;

/// Whatever hangs fails instead.
const PATIENCE: Duration = Duration::from_secs(120);

/// A request frame to the instrument: on which connection, and what.
#[derive(Debug, Clone, PartialEq)]
enum Frame {
    State(usize),
    Write(usize, u16, Vec<u16>),
    Unanswered,
}

/// How the instrument behaves.
#[derive(Default)]
struct Ways {
    /// It takes no block that switches off, and not the output's own register either.
    refuses_output: AtomicBool,
    /// It answers no question for a state.
    silent: AtomicBool,
    /// It cuts its connection, once.
    cuts: AtomicBool,
    /// Its output, and how many states it has given.
    output: Mutex<(bool, u16)>,
}

/// One connection: requests are answered until either side ends it.
fn serve(mut stream: TcpStream, number: usize, ways: &Ways, frames: &Sender<Frame>) -> std::io::Result<()> {
    loop {
        let mut head = [0; 8];
        stream.read_exact(&mut head)?;
        let mut body = vec![0; usize::from(u16::from_be_bytes([head[4], head[5]])) - 2];
        stream.read_exact(&mut body)?;
        if ways.cuts.swap(false, Ordering::SeqCst) {
            return Ok(());
        }
        let mut answer = vec![head[7]];
        if head[7] == 3 && ways.silent.load(Ordering::SeqCst) {
            let _ = frames.send(Frame::Unanswered);
            continue;
        }
        if head[7] == 3 {
            let _ = frames.send(Frame::State(number));
            let mut output = ways.output.lock().unwrap();
            output.1 += 1;
            let registers = state(output.1, output.0);
            answer.push(registers.len() as u8);
            answer.extend(registers);
        } else {
            let address = u16::from_be_bytes([body[0], body[1]]);
            let registers: Vec<u16> =
                body[5..].chunks_exact(2).map(|pair| u16::from_be_bytes([pair[0], pair[1]])).collect();
            let enable = registers.get(usize::from(103_u16.wrapping_sub(address))).copied();
            let _ = frames.send(Frame::Write(number, address, registers));
            if enable == Some(0) && ways.refuses_output.load(Ordering::SeqCst) {
                answer = vec![head[7] | 0x80, 3];
            } else {
                answer.extend(&body[..4]);
                // An amplitude by itself is one of zero: the plate stands.
                ways.output.lock().unwrap().0 = enable.is_some_and(|enable| enable != 0);
            }
        }
        let mut whole = head[..7].to_vec();
        whole[4..6].copy_from_slice(&(answer.len() as u16 + 1).to_be_bytes());
        whole.extend(answer);
        stream.write_all(&whole)?;
    }
}

/// An instrument on a port of this machine, and the requests that it gets.
fn instrument() -> (String, Arc<Ways>, Receiver<Frame>) {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap().to_string();
    let (sender, requests) = channel();
    let ways = Arc::<Ways>::default();
    let shared = Arc::clone(&ways);
    std::thread::spawn(move || {
        for (number, stream) in listener.incoming().enumerate() {
            // The client ends a connection by dropping it.
            let _ = serve(stream.unwrap(), number + 1, &shared, &sender);
        }
    });
    (address, ways, requests)
}

/// The driver of that instrument, driving; answers may take an hour. Requests from the first 'on' on stay in
/// `requests`.
fn driving(
    address: &str,
    requests: &Receiver<Frame>,
) -> (JoinHandle<Closed>, Arc<AtomicBool>, AmplifierPort) {
    let mut profile = crate::profile("muprime-amplifier").unwrap();
    profile.description.link.response_timeout_ms = 3_600_000;
    let (endpoint, mut port) = Endpoint::amplifier(profile, &InstrumentSetup::new("", "")).unwrap();
    let (ready, opened) = sync_channel(1);
    let stop = Arc::<AtomicBool>::default();
    let connection = Connection::new(endpoint, Instant::now(), Arc::clone(&stop), ready);
    let thread = spawn(&InstrumentSetup::new("muprime-amplifier", address), connection).unwrap();
    assert_eq!(opened.recv_timeout(PATIENCE), Ok(Ok(())));
    port.push(on(1, u64::MAX));
    let on = |one: &Frame| matches!(one, Frame::Write(_, 100, registers) if registers[3] == 1);
    while !on(&requests.recv_timeout(PATIENCE).unwrap()) {}
    (thread, stop, port)
}

/// The writes among the requests, up to the one that is looked for.
fn writes_until(requests: &Receiver<Frame>, is: impl Fn(&Frame) -> bool) -> Vec<Frame> {
    let mut writes = Vec::new();
    loop {
        let request = requests.recv_timeout(PATIENCE).expect("no request came");
        let found = is(&request);
        if matches!(request, Frame::Write(..)) {
            writes.push(request);
        }
        if found {
            return writes;
        }
    }
}

#[test]
fn a_set_point_that_is_refused_keeps_no_other_from_being_sent() {
    let (address, ways, requests) = instrument();
    let (thread, stop, _port) = driving(&address, &requests);
    ways.refuses_output.store(true, Ordering::SeqCst);
    stop.store(true, Ordering::Release);
    let amplitude = |one: &Frame| matches!(one, Frame::Write(_, 100, registers) if *registers == [0]);
    let writes = writes_until(&requests, amplitude);
    let [block, output, amplitude] = &writes[..] else { panic!("{writes:?}") };
    assert!(matches!(block, Frame::Write(1, 100, registers) if registers.len() == 5 && registers[3] == 0));
    assert_eq!((output, amplitude), (&Frame::Write(1, 103, vec![0]), &Frame::Write(1, 100, vec![0])));
    assert_eq!(thread.join().unwrap(), Closed::ReadBackOff, "what it shows counts");
}

#[test]
fn a_new_connection_begins_with_off() {
    let (address, ways, requests) = instrument();
    let (thread, stop, port) = driving(&address, &requests);
    ways.cuts.store(true, Ordering::SeqCst);
    // Neither state nor signature is read before.
    let first = loop {
        match requests.recv_timeout(PATIENCE).unwrap() {
            Frame::State(1) | Frame::Write(1, ..) => {}
            first => break first,
        }
    };
    assert!(
        matches!(&first, Frame::Write(2, 100, registers) if registers[3] == 0 && registers[0] == 0),
        "{first:?}"
    );
    stop.store(true, Ordering::Release);
    assert_eq!(thread.join().unwrap(), Closed::ReadBackOff);
    drop(port);
}

/// An amplifier takes its set-points and answers no question: 'off' waited as long as an answer may take. So
/// did the 'off' that is due because the loop's command has expired.
#[test]
fn an_off_waits_for_no_answer_that_stays_away() {
    for by in ["stop", "off", "expiry"] {
        let (address, ways, requests) = instrument();
        let (thread, stop, mut port) = driving(&address, &requests);
        ways.silent.store(true, Ordering::SeqCst);
        while requests.recv_timeout(PATIENCE).unwrap() != Frame::Unanswered {}
        ways.silent.store(false, Ordering::SeqCst);
        match by {
            "stop" => stop.store(true, Ordering::Release),
            "expiry" => port.push(on(2, 0)),
            _ => port.push(DriveSetPoint { enable: false, ..on(2, u64::MAX) }),
        }
        let first = requests.recv_timeout(PATIENCE).expect("'off' waits for the answer");
        assert!(matches!(&first, Frame::Write(2, 100, registers) if registers[3] == 0), "{first:?}");
        stop.store(true, Ordering::Release);
        assert_eq!(thread.join().unwrap(), Closed::ReadBackOff);
    }
}
