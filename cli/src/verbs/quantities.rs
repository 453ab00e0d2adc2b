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

/// The same command, whose flags for quantities take units.
pub fn with_units(mut command: clap::Command) -> clap::Command {
    let number = ValueParser::from(value_parser!(f64)).type_id();
    let taken: Vec<(clap::Id, &'static str)> = command
        .get_arguments()
        .filter(|arg| arg.get_value_parser().type_id() == number)
        .filter_map(|arg| Some((arg.get_id().clone(), unit(arg.get_id().as_str())?)))
        .collect();
    for (id, unit) in taken {
        command =
            command.mut_arg(id, |arg| arg.value_parser(move |text: &str| runs::quantity::parse(text, unit)));
    }
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
}
