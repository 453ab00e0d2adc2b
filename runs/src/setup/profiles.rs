//! A setup's instruments against their profiles: what is named exists, and fits what it is named for.

use super::{Setup, SetupFile};
use crate::fingertip::{self, Fingertip};
use crate::run_dir::sha256_of;
use drivers::endpoint::Endpoint;
use drivers::ports::compose;
use drivers::user_profiles::{Library, Source};
use drivers::{InstrumentSetup, SetupError, bundled};
use instruments::codec::can::MOST_EXTENDED;
use instruments::traffic::LineSetup;
use instruments::{LinkKind, Profile, SignalId};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};

/// A folder that the command line names.
static NAMED: OnceLock<PathBuf> = OnceLock::new();

/// Profiles are looked for in this folder too, from now on. The first call counts.
pub fn look_in(folder: Option<PathBuf>) {
    if let Some(folder) = folder {
        let _ = NAMED.set(folder);
    }
}

/// The named folder and the user's own, `~/.config/muprime/profiles`.
pub fn library() -> Library {
    let home = || std::env::var_os("HOME").map(|home| PathBuf::from(home).join(".config"));
    let config =
        std::env::var_os("XDG_CONFIG_HOME").map(PathBuf::from).filter(|p| p.is_absolute()).or_else(home);
    let own = config.map(|config| config.join("muprime/profiles"));
    Library::of(NAMED.get().cloned().into_iter().chain(own).collect())
}

/// Where a problem stands in the setup, as a path of keys, and what it is.
type InputProblem = (Vec<&'static str>, String);

/// Reads the profiles that do not come with the program, and puts each beside its instrument. Returns those that cannot be read.
pub(super) fn resolve(file: &mut SetupFile, folder: &Path) -> Vec<InputProblem> {
    let library = library();
    let mut read: BTreeMap<String, Arc<Source>> = BTreeMap::new();
    let mut problems = Vec::new();
    let mut one = |name: &mut String, source: &mut Option<Arc<Source>>, place: Vec<&'static str>| {
        let found = match library.find(name, folder) {
            Ok(Some(found)) => found,
            Ok(None) => return,
            Err(error) => return problems.push((place, error.to_string())),
        };
        let stored = read.entry(found.id.clone()).or_insert_with(|| Arc::clone(&found));
        if stored.text != found.text || stored.files != found.files {
            let (a, b) = (stored.origin.display(), found.origin.display());
            let problem =
                format!("{a} and {b} are two profiles of one id, `{}`: give one another `id`", found.id);
            return problems.push((place, problem));
        }
        name.clone_from(&stored.id);
        *source = Some(Arc::clone(stored));
    };
    for (table, instrument) in file.by_table_mut() {
        one(&mut instrument.profile, &mut instrument.source, place(table, "profile"));
    }
    if let Some(chamber) = &mut file.chamber {
        one(&mut chamber.profile, &mut chamber.source, vec!["chamber", "profile"]);
    }
    if let Some(vibrometer) = &mut file.vibrometer {
        one(&mut vibrometer.profile, &mut vibrometer.source, vec!["vibrometer", "profile"]);
    }
    problems
}

/// The signal that gives an axis of force.
pub struct ForceAxisSignal<'a> {
    /// `lateral` or `normal`.
    pub name: &'static str,
    /// The instrument that it is of.
    pub instrument: &'a InstrumentSetup,
    /// That instrument's profile.
    pub profile: Profile,
    /// Its signal.
    pub signal: SignalId,
    /// `gain` of the setup, 1 where it states none.
    pub gain: f64,
}

impl ForceAxisSignal<'_> {
    /// The signal as the profile describes it.
    pub fn described(&self) -> &instruments::schema::Signal {
        &self.profile.description.signal[self.signal.0]
    }

    /// The signal, its profile and the axis, in words.
    fn shown(&self) -> String {
        format!("`{}` of `{}` ({})", self.described().name.as_ref(), self.instrument.profile, self.name)
    }
}

impl SetupFile {
    /// The axes of force that its instruments give, by the setup or by the names of their signals.
    pub fn axes(&self) -> impl Iterator<Item = ForceAxisSignal<'_>> {
        self.force.iter().flat_map(|instrument| {
            let both = [("lateral", &instrument.lateral), ("normal", &instrument.normal)];
            both.into_iter().filter_map(move |(name, stated)| {
                let profile = instrument.description().ok()?;
                let (signal, gain) = stated.as_ref().map_or((name, 1.0), |a| (a.signal.as_str(), a.gain));
                Some(ForceAxisSignal { name, instrument, signal: profile.signal(signal)?, profile, gain })
            })
        })
    }

    /// Its instruments, each with the table in which it stands; the chamber, which takes no part in the loop,
    /// is none of them.
    pub fn by_table(&self) -> Vec<(&'static str, &InstrumentSetup)> {
        let force = self.force.iter().map(|instrument| ("force", instrument));
        let relay = self.supply_relay.iter().map(|instrument| ("supply_relay", instrument));
        let inputs = self.safety_inputs.iter().map(|instrument| ("safety_inputs", instrument));
        force
            .chain([("amplifier", &self.amplifier), ("stage", &self.stage)])
            .chain(relay)
            .chain(inputs)
            .collect()
    }

    /// The same, to be changed.
    pub(super) fn by_table_mut(&mut self) -> Vec<(&'static str, &mut InstrumentSetup)> {
        let SetupFile { force, amplifier, stage, supply_relay, safety_inputs, .. } = self;
        let force = force.iter_mut().map(|instrument| ("force", instrument));
        let relay = supply_relay.iter_mut().map(|instrument| ("supply_relay", instrument));
        let inputs = safety_inputs.iter_mut().map(|instrument| ("safety_inputs", instrument));
        force.chain([("amplifier", amplifier), ("stage", stage)]).chain(relay).chain(inputs).collect()
    }
}

/// The key of an instrument in its table; sensors of force have a list of tables, without places.
pub(super) fn place(table: &'static str, key: &'static str) -> Vec<&'static str> {
    if table == "force" { vec![table] } else { vec![table, key] }
}

/// Whether every instrument can be what the setup names it for, on the line that the setup states: all that do not.
pub(super) fn fit(file: &SetupFile) -> Vec<InputProblem> {
    let all = file.by_table();
    let mut problems = Vec::new();
    for &(table, instrument) in &all {
        let place = |key| place(table, key);
        if let Err((key, problem)) = one_fits(table, instrument) {
            let problem = format!("instrument `{}` at {}: {problem}", instrument.profile, instrument.address);
            problems.push((place(key), problem));
            continue;
        }
        if file.virtual_rig.is_some() && instrument.address.starts_with("tcp:") {
            let problem = "the virtual rig serves a serial line as `pty` or at a path, not over TCP";
            problems.push((place("address"), problem.into()));
            continue;
        }
        if file.virtual_rig.is_some() {
            let served = instrument.description().map_err(|error| error.to_string());
            let served = served.and_then(|profile| {
                sim::wire::device::Device::new(profile).map(drop).map_err(|error| error.to_string())
            });
            problems.extend(served.err().map(|problem| (place("profile"), problem)));
        }
    }
    if problems.is_empty() {
        problems.extend(twice(&all));
        problems.extend(one_signal(file));
        problems.extend(share_lines(&all).err());
    }
    problems
}

/// Instruments of different profiles at one place, where only one of them can be. One board may be named for two things.
fn twice(all: &[(&'static str, &InstrumentSetup)]) -> Vec<InputProblem> {
    let place = |instrument: &InstrumentSetup| {
        let link = instrument.description().ok()?.description.link;
        let number = match link.kind {
            LinkKind::ModbusTcp | LinkKind::ModbusRtu => {
                format!("unit {}", instrument.unit.or(link.unit).unwrap_or(1))
            }
            LinkKind::Canopen => format!("node {}", instrument.base.or(link.node.map(u32::from))?),
            LinkKind::Scpi if !instrument.address.ends_with(":0") => "that port".to_string(),
            _ => return None,
        };
        Some((instrument.address.clone(), number))
    };
    let mut seen: BTreeMap<(String, String), &str> = BTreeMap::new();
    let mut problems = Vec::new();
    for (table, instrument) in all {
        let Some(at) = place(instrument) else { continue };
        let (address, number) = at.clone();
        let first = *seen.entry(at).or_insert(&instrument.profile);
        if first != instrument.profile {
            let problem = format!(
                "`{first}` and `{}` are both at {address}, {number}: correct an `address`, or give one another `unit`",
                instrument.profile
            );
            problems.push((self::place(table, "address"), problem));
        }
    }
    problems
}

/// A signal of one instrument that two tables of force name. Each `pty` is an instrument of its own, and so
/// is each free port but that of Modbus TCP, whose units share one.
fn one_signal(file: &SetupFile) -> Option<InputProblem> {
    let own = |axis: &ForceAxisSignal<'_>| {
        let (address, kind) = (&axis.instrument.address, axis.profile.description.link.kind);
        address.ends_with("pty") || address.ends_with(":0") && kind != LinkKind::ModbusTcp
    };
    let axes: Vec<ForceAxisSignal<'_>> = file.axes().filter(|axis| !own(axis)).collect();
    let place = |axis: &ForceAxisSignal<'_>| {
        let (i, link) = (axis.instrument, &axis.profile.description.link);
        let unit = i.unit.or(link.unit);
        (i.address.clone(), i.profile.clone(), unit, i.base.or(link.base), axis.signal.0)
    };
    let again = (1..axes.len()).find(|&k| axes[..k].iter().any(|before| place(before) == place(&axes[k])));
    let signal = again.map(|k| axes[k].described().name.as_ref().clone());
    signal.map(|signal| (vec!["force"], SetupError::OneSignal(signal).to_string()))
}

/// Whether instruments at one serial line can share it: sensors with Modbus RTU can.
fn share_lines(all: &[(&'static str, &InstrumentSetup)]) -> Result<(), InputProblem> {
    let line = |instrument: &InstrumentSetup| {
        let path = instrument.address.split_once(':').map_or(instrument.address.as_str(), |(_, path)| path);
        let kind = instrument.description().ok()?.description.link.kind;
        let over_rtu = instrument.address.starts_with("rtu:");
        let serial = over_rtu || matches!(kind, LinkKind::ModbusRtu | LinkKind::Serial);
        // Each `pty` is a line of its own. A line that is not plugged in is one line all the same.
        let path =
            Some(path).filter(|path| serial && *path != "pty" && !instrument.address.starts_with("tcp:"))?;
        let path = std::fs::canonicalize(path).unwrap_or_else(|_| path.into());
        Some((path, over_rtu || kind == LinkKind::ModbusRtu))
    };
    let mut lines: BTreeMap<PathBuf, Vec<(&'static str, &InstrumentSetup, bool)>> = BTreeMap::new();
    for ((path, rtu), (table, instrument)) in all.iter().filter_map(|one| Some((line(one.1)?, *one))) {
        lines.entry(path).or_default().push((table, instrument, rtu));
    }
    for (path, shared) in lines.into_iter().filter(|(_, shared)| shared.len() > 1) {
        let mut share = 0.0;
        for (table, instrument, rtu) in shared {
            let profile =
                instrument.description().map_err(|error| (place(table, "address"), error.to_string()))?;
            let problem = if !rtu || profile.description.stream.is_some() {
                "only units of Modbus RTU that are polled can share a line"
            } else if !matches!(table, "force" | "safety_inputs") {
                "what takes set-points needs a line of its own: another unit's silence would hold up an 'off'"
            } else {
                let line = LineSetup { over_rtu: true, ..line_of(instrument) };
                share += profile.line_share(line).unwrap_or(0.0);
                continue;
            };
            let problem = format!("`{}` at {}: {problem}", instrument.profile, path.display());
            return Err((place(table, "address"), problem));
        }
        if share > 1.0 {
            let (path, taken) = (path.display(), share * 1e2);
            let problem = format!(
                "the units at {path} take {taken:.0} % of its capacity together; state a lower `rate_hz`"
            );
            return Err((vec!["force"], problem));
        }
    }
    Ok(())
}

fn line_of(instrument: &InstrumentSetup) -> LineSetup {
    LineSetup {
        over_rtu: instrument.address.starts_with("rtu:"),
        over_tcp: instrument.address.starts_with("tcp:"),
        baud: instrument.baud,
        rate_hz: instrument.rate_hz,
    }
}

/// The first key that the driver of the instrument would ignore.
fn meaningless(table: &str, i: &InstrumentSetup, profile: &Profile) -> Option<&'static str> {
    use LinkKind::{Can, Canopen, ModbusRtu, ModbusTcp, Serial};
    let (kind, rtu) = (profile.description.link.kind, i.address.starts_with("rtu:"));
    let line = rtu || (matches!(kind, ModbusRtu | Serial) && !i.address.starts_with("tcp:"));
    let keys = [
        ("unit", i.unit.is_some(), matches!(kind, ModbusRtu | ModbusTcp)),
        ("base", i.base.is_some(), matches!(kind, Can | Canopen)),
        ("baud", i.baud.is_some(), line),
        ("amplitude_m_per_unit", i.amplitude_m_per_unit.is_some(), table == "amplifier"),
        (
            "measured_m_per_unit",
            i.measured_m_per_unit.is_some(),
            table == "amplifier" && profile.signal("amplitude").is_some(),
        ),
        ("wired", i.wired.is_some(), table == "safety_inputs"),
        ("dead_weight_n", i.dead_weight_n.is_some(), table == "stage"),
        ("lateral", i.lateral.is_some(), table == "force"),
        ("normal", i.normal.is_some(), table == "force"),
    ];
    keys.into_iter().find(|(_, stated, read)| *stated && !read).map(|(key, ..)| key)
}

/// Roles, signals and set-points, then the line's capacity; with the key that is to blame.
fn one_fits(table: &str, instrument: &InstrumentSetup) -> Result<(), (&'static str, String)> {
    let profile = instrument.description().map_err(|error| ("profile", error.to_string()))?;
    let line = line_of(instrument);
    if line.over_tcp && profile.description.link.kind != LinkKind::Serial {
        return Err(("address", "`tcp:` is for serial lines behind a device server; leave it out".into()));
    }
    let share = profile.line_share(line);
    if let Some(key) = meaningless(table, instrument, &profile) {
        return Err((key, format!("`{key}` means nothing for this instrument: leave it out")));
    }
    let link = &profile.description.link;
    let base = instrument.base.or(link.base).unwrap_or(0);
    let last = profile.last_identifier(base);
    if link.kind == LinkKind::Can && last > u64::from(MOST_EXTENDED) {
        return Err((
            "base",
            format!("from a base of {base:#x} on identifiers go up to {last:#x}, beyond 29 bits"),
        ));
    }
    match table {
        "force" => Endpoint::force(profile, instrument).map(drop),
        "amplifier" => Endpoint::amplifier(profile, instrument).map(drop),
        "stage" => Endpoint::stage(profile, instrument).map(drop),
        "supply_relay" => Endpoint::supply(profile).map(drop),
        _ => Endpoint::contacts(profile, instrument).map(drop),
    }
    .map_err(|problem| ("profile", problem.to_string()))?;
    let Some(share) = share.filter(|share| *share > 1.0) else { return Ok(()) };
    let problem = format!(
        "its samples take {:.0} % of the line's capacity; state a lower `rate_hz` or a higher `baud`",
        share * 1e2
    );
    Err((if instrument.rate_hz.is_some() { "rate_hz" } else { "profile" }, problem))
}

impl Setup {
    /// Whether the force instruments together give each axis once, as a run needs it; a look at one instrument does not.
    ///
    /// # Errors
    /// What is missing, or given twice.
    pub fn has_both_axes(&self) -> Result<(), Box<dyn std::error::Error>> {
        let mut ports = Vec::new();
        for instrument in &self.file.force {
            ports.push(Endpoint::force(instrument.description()?, instrument)?.1);
        }
        compose(ports)?;
        let bare = |axis: &ForceAxisSignal<'_>| axis.described().si.unit != "N" && axis.gain.abs() == 1.0;
        let unknown = self.file.axes().find(bare).filter(|_| self.certificates.force.is_none());
        let Some(axis) = unknown else { return Ok(()) };
        let (shown, unit) = (axis.shown(), &axis.described().si.unit);
        Err(format!("signal {shown} is in {unit:?}, not in N, and has neither `gain` nor certificate").into())
    }

    /// The profiles of its instruments, and the files that they name, by file name: for the record.
    pub fn profiles(&self) -> Vec<(String, String)> {
        let mut files = BTreeMap::new();
        for instrument in self.instruments().all() {
            match &instrument.source {
                Some(source) => {
                    files.insert(format!("{}.toml", source.id), source.text.clone());
                    files.extend(source.files.iter().cloned());
                }
                None => {
                    let text = bundled::text(&instrument.profile).map(String::from);
                    files.extend(text.map(|text| (format!("{}.toml", instrument.profile), text)));
                }
            }
        }
        files.into_iter().collect()
    }

    /// What identifies the setup: its text, and what it names that does not come with the program: profiles,
    /// certificates, the fingertip's values.
    pub fn sha256(&self) -> String {
        let instruments = self.instruments();
        let sources = instruments.all().filter_map(|instrument| instrument.source.as_ref());
        let mut named: Vec<String> =
            sources.flat_map(|s| s.files.iter().map(|(_, text)| text).chain([&s.text]).cloned()).collect();
        named.extend(self.certificates.files.iter().map(|(_, text)| text.clone()));
        let Fingertip { name, kind, mu0, finger } = &self.tip;
        let own = crate::bundled::text(fingertip::BUNDLED, &self.file.finger.tip).is_none();
        named.extend(own.then(|| serde_json::json!([name, kind, mu0, finger]).to_string()));
        sha256_of(&self.text, named.iter().map(String::as_bytes))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The ideal virtual rig with one line changed.
    fn changed(from: &str, to: &str) -> Result<Setup, String> {
        let text = Setup::load("virtual-ideal").unwrap().text;
        assert!(text.contains(from), "{text}");
        Setup::parse("changed", &text.replacen(from, to, 1), Path::new(".")).map_err(|e| format!("{e:?}"))
    }

    #[test]
    fn a_profile_that_does_not_exist_is_refused_with_what_there_is() {
        let text = changed("profile = \"muprime-force2\"", "profile = \"no-such-thing\"").unwrap_err();
        assert!(
            text.contains("no-such-thing") && text.contains("hbk-wtx110") && text.contains("profiles"),
            "{text}"
        );
    }

    #[test]
    fn an_instrument_that_cannot_be_what_it_is_named_for_is_refused() {
        let text = changed("profile = \"muprime-amplifier\"", "profile = \"muprime-stage\"").unwrap_err();
        assert!(text.contains("echo_amplitude"), "{text}");
    }

    #[test]
    fn samples_that_do_not_fit_the_line_are_refused() {
        let rtu = |baud: u32| {
            let one = "profile = \"muprime-force2\"\naddress = \"127.0.0.1:0\"";
            let other =
                format!("profile = \"muprime-force2\"\naddress = \"rtu:pty\"\nbaud = {baud}\nrate_hz = 100");
            changed(one, &other)
        };
        let text = rtu(9600).unwrap_err();
        assert!(text.contains("capacity"), "{text}");
        rtu(115_200).unwrap();
    }

    #[test]
    fn a_base_whose_identifiers_have_more_than_29_bits_is_refused() {
        let at = |base: u32| {
            let text = Setup::load("virtual-slcan").unwrap().text;
            let text = text.replacen("slcan:pty\"", &format!("slcan:pty\"\nbase = {base}"), 1);
            Setup::parse("changed", &text, Path::new(".")).map_err(|e| format!("{e:?}"))
        };
        at(0x1FFF_FF00).unwrap();
        let text = at(0x1FFF_FFFF).unwrap_err();
        assert!(text.contains("beyond 29 bits"), "{text}");
    }

    #[test]
    fn one_signal_is_not_an_axis_of_two_tables() {
        let one = "[[force]]\nprofile = \"muprime-force2\"\naddress = \"127.0.0.1:0\"";
        let axis = |axis: &str, signal: &str| format!("{one}\n{axis} = {{ signal = \"{signal}\" }}\n");
        // Each of them gives its other axis by the name of its signal, which is the other's.
        let text = changed(one, &format!("{}{}", axis("lateral", "lateral"), axis("normal", "normal")));
        let text = text.unwrap_err();
        assert!(text.contains("cannot be both axes"), "{text}");
    }

    #[test]
    fn sensors_share_a_line_and_what_takes_set_points_does_not() {
        let line = std::env::temp_dir().join(format!("muprime-line-{}", std::process::id()));
        std::fs::write(&line, "").unwrap();
        let axis = |axis: &str, unit: u8, rate_hz: f64| {
            format!(
                "[[force]]\nprofile = \"robotiq-ft300\"\naddress = \"{}\"\nunit = {unit}\nrate_hz = {rate_hz}\n\
                 {axis} = {{ signal = \"fz\" }}\n",
                line.display()
            )
        };
        let both = |rate_hz: f64| {
            let one = "[[force]]\nprofile = \"muprime-force2\"\naddress = \"127.0.0.1:0\"";
            changed(one, &format!("{}{}", axis("lateral", 9, rate_hz), axis("normal", 10, rate_hz)))
        };
        let (good, full) = (both(25.0), both(50.0));
        let stage = "profile = \"muprime-stage\"\naddress = \"127.0.0.1:0\"";
        let shared = format!(
            "profile = \"muprime-stage\"\naddress = \"rtu:{}\"\nbaud = 19200\nrate_hz = 20",
            line.display()
        );
        let text = good.as_ref().unwrap().text.replacen(stage, &shared, 1);
        let moved = Setup::parse("changed", &text, Path::new(".")).map_err(|e| format!("{e:?}"));
        std::fs::remove_file(&line).unwrap();
        let full = full.unwrap_err();
        assert!(full.contains("together"), "{full}");
        let moved = moved.unwrap_err();
        assert!(moved.contains("of its own"), "{moved}");
    }

    /// A run was taken up with another tip or another certificate, and stated as one.
    #[test]
    fn a_tip_of_its_own_and_certificates_are_part_of_a_setups_identity() {
        let folder = tempfile::tempdir().unwrap();
        let bundled = Setup::load("virtual-ideal").unwrap();
        assert_eq!(bundled.sha256(), calibration::certificate::sha256_hex(bundled.text.as_bytes()));
        let text = bundled.text.replacen("\"artificial-silicone\"", "\"tip.toml\"", 1);
        let with = |tip: &str| {
            std::fs::write(folder.path().join("tip.toml"), tip).unwrap();
            Setup::parse("own", &text, folder.path()).unwrap()
        };
        let tip = fingertip::BUNDLED[0].1;
        let mut setup = with(tip);
        for other in [tip.replacen("3.9e6", "2.9e6", 1), tip.replacen("mu0 = 0.5", "mu0 = 0.8", 1)] {
            assert_ne!(other, tip);
            assert_ne!(with(&other).sha256(), setup.sha256(), "{other}");
        }
        assert_eq!(with(&format!("# a comment\n{tip}")).sha256(), setup.sha256());
        let without = setup.sha256();
        setup.certificates.files = vec![("certificates/c.toml".into(), "gain 1.00".into())];
        let first = setup.sha256();
        setup.certificates.files[0].1 = "gain 0.85".into();
        assert!(first != without && setup.sha256() != first);
    }

    #[test]
    fn a_profile_beside_the_setup_is_used_kept_and_part_of_its_identity() {
        let folder = std::env::temp_dir().join(format!("muprime-beside-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let own = bundled::text("muprime-force2").unwrap().replacen("\"muprime-force2\"", "\"own-cell\"", 1);
        std::fs::write(folder.join("cell.toml"), &own).unwrap();
        let text =
            Setup::load("virtual-ideal").unwrap().text.replacen("\"muprime-force2\"", "\"cell.toml\"", 1);
        let parsed = Setup::parse("own", &text, &folder).unwrap();
        std::fs::write(folder.join("cell.toml"), own.replacen("maker = \"", "maker = \"other ", 1)).unwrap();
        let later = Setup::parse("own", &text, &folder).unwrap();
        std::fs::remove_dir_all(&folder).unwrap();
        assert_eq!(parsed.file.force[0].profile, "own-cell");
        assert!(parsed.profiles().contains(&("own-cell.toml".into(), own)));
        assert_eq!(parsed.instruments().force[0].description().unwrap().id(), "own-cell");
        assert_ne!(parsed.sha256(), later.sha256(), "another profile is another setup");
    }

    /// The ideal virtual rig with these lines after the profile of its sensor, amplifier or stage.
    fn with(instrument: &str, more: &str) -> Result<Setup, String> {
        let profile = format!("profile = \"muprime-{instrument}\"");
        changed(&profile, &format!("{profile}\n{more}"))
    }

    #[test]
    fn a_key_that_its_instrument_does_not_read_is_refused() {
        for (instrument, more, key) in [
            ("force2", "dead_weight_n = 0.2", "dead_weight_n"),
            ("force2", "wired = [\"dead_man\"]", "wired"),
            ("force2", "amplitude_m_per_unit = 1e-6", "amplitude_m_per_unit"),
            ("force2", "baud = 9600", "baud"),
            ("amplifier", "base = 5", "base"),
            ("amplifier", "lateral = { signal = \"fault\" }", "lateral"),
            ("stage", "measured_m_per_unit = 1e-6", "measured_m_per_unit"),
        ] {
            let why = with(instrument, more).map(|_| ()).unwrap_err();
            assert!(why.contains(&format!("`{key}` means")), "{more}: {why}");
        }
        with("force2", "unit = 1").unwrap();
    }

    #[test]
    fn an_axis_is_a_force_of_its_own() {
        let why = with("force2", "lateral = { signal = \"normal\" }").map(|_| ()).unwrap_err();
        assert!(why.contains("both axes"), "{why}");
        let status = with("force2", "lateral = { signal = \"fault\" }").unwrap();
        let why = status.has_both_axes().unwrap_err().to_string();
        assert!(why.contains("`fault`") && why.contains("not in N"), "{why}");
        with("force2", "lateral = { signal = \"lateral\", gain = -1.0 }").unwrap().has_both_axes().unwrap();
    }
}
