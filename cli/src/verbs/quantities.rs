//! Units on the command line: every flag that is a quantity takes `2um` and the like. The flag's name says its SI unit.

use clap::builder::ValueParser;
use clap::value_parser;
use runs::input::unit_of;

/// The SI unit of a flag by its name; none where the name ends in a unit that has no prefixes in use.
fn unit(id: &str) -> Option<&'static str> {
    let plain = match id {
        "live" => "m",
        _ if id.ends_with("_pa_m") => return None,
        _ if id.ends_with("_per_s") && !id.ends_with("_m_per_s") => return None,
        _ => unit_of(id),
    };
    Some(plain).filter(|unit| ["m", "Hz", "m/s", "N", "N/m", "N/s", "Pa", "s"].contains(unit))
}

/// The same command, whose flags for quantities take units. What follows a flag for a number is its value,
/// also `-2e-6`: the flag's own range judges it, where it would have been an option that nobody knows.
pub fn with_units(command: clap::Command) -> clap::Command {
    let types: [ValueParser; 3] =
        [value_parser!(f64).into(), value_parser!(u64).into(), value_parser!(usize).into()];
    let command = command.mut_args(|arg| {
        let Some(kind) = types.iter().position(|t| t.type_id() == arg.get_value_parser().type_id()) else {
            return arg;
        };
        let one = arg.get_num_args().is_none_or(|n| n.min_values() == n.max_values()) && !arg.is_positional();
        let unit = unit(arg.get_id().as_str()).filter(|_| kind == 0);
        let arg = arg.allow_hyphen_values(one);
        match unit {
            Some(unit) => arg.value_parser(move |text: &str| runs::parse_quantity::parse(text, unit)),
            None => arg,
        }
    });
    let names: Vec<String> = command.get_subcommands().map(|s| s.get_name().to_string()).collect();
    names.iter().fold(command, |command, name| command.mut_subcommand(name, with_units))
}

#[cfg(test)]
mod tests {
    use super::with_units;

    fn count(command: &clap::Command) -> (usize, usize) {
        let number = clap::builder::ValueParser::from(clap::value_parser!(f64)).type_id();
        let own = command.get_arguments().filter(|a| a.get_value_parser().type_id() == number);
        let mut all = own.fold((0, 0), |(all, named), a| {
            (all + 1, named + usize::from(super::unit(a.get_id().as_str()).is_some()))
        });
        for sub in command.get_subcommands() {
            let (below, named) = count(sub);
            all = (all.0 + below, all.1 + named);
        }
        all
    }

    /// The quantities are found by their names, and units reach them.
    #[test]
    fn flags_of_quantities_take_units() {
        let (numbers, quantities) = count(&crate::command());
        assert!(quantities > 25 && quantities < numbers, "{quantities} of {numbers}");
        let words = ["muprime", "model", "point", "--amplitude-pp-m", "2um", "--speed-m-s", "20mm/s"];
        assert!(crate::parsed(words.map(Into::into)).is_ok());
        let wrong = ["muprime", "model", "point", "--amplitude-pp-m", "2N"];
        let message = crate::parsed(wrong.map(Into::into)).err().map(|e| e.to_string()).unwrap_or_default();
        assert!(message.contains("write 2um"), "{message}");
        with_units(crate::command()).debug_assert();
    }

    /// `-2e-6` and `-1` were options that nobody knows, and the advice was `-- -1`.
    #[test]
    fn a_negative_number_is_judged_by_its_range() {
        let words = |line: &str| line.split(' ').map(Into::into).collect::<Vec<std::ffi::OsString>>();
        for line in [
            "muprime model point --amplitude-pp-m -2e-6 --speed-m-s -2mm/s --mu0 -1",
            "muprime model ridge --young-modulus-pa -1e6 --json",
            "muprime model amplitude-for --lateral-force-n -1e-3",
        ] {
            if let Err(error) = crate::parsed(words(line)) {
                panic!("{line}: {error}");
            }
        }
        let message = crate::parsed(words("muprime run --seed -1")).err().unwrap().to_string();
        let message = crate::cli::plain(&message);
        assert!(
            message.contains("'-1' for '--seed <SEED>': a whole number, 0 or more, is expected"),
            "{message}"
        );
        assert!(!message.contains("-- -1"), "{message}");
    }
}
