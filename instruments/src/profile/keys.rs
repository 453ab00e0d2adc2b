//! Where each key is read: one that its link, its roles or its neighbours would leave unread is refused.

use super::compile::Compiler;
use crate::error::ProfileError;
use toml::de::{DeTable, DeValue};

/// What decides whether a key is read: kinds of link, roles, keys that must or must not be beside it.
enum Read {
    Over,
    By,
    With,
    Without,
}
use Read::{By, Over, With, Without};

/// The roles of the loop, whose drivers read most.
const LOOP: &str =
    "force.lateral force.normal drive.ultrasonic motion.slide motion.load safety.supply safety.contacts";

/// Where keys are read; `.key` is a section, and a neighbour without a point is in the same table.
const KEYS: &[(Read, &str, &str)] = &[
    (Over, "modbus_tcp modbus_rtu", ".poll link.unit init.copy init.registers write.table write.address"),
    (Over, "modbus_rtu", "stream.start_register stream.start_function stream.stop stream.settle_ms"),
    (Over, "modbus_rtu", "stream.stop_before_open init.function"),
    (Over, "modbus_rtu serial tcp udp", ".stream"),
    (Over, "modbus_tcp modbus_rtu serial", "link.baud link.format"),
    (Over, "modbus_tcp modbus_rtu canopen", ".write set.block set.register set.type set.byte_order"),
    (Over, "modbus_tcp modbus_rtu canopen serial tcp scpi", ".set"),
    (Over, "modbus_tcp serial tcp udp scpi", "link.port"),
    (Over, "modbus_tcp serial tcp scpi", "link.connect_timeout_ms"),
    (Over, "can canopen", ".message link.bitrate"),
    (Over, "can", "link.dbc link.base message.request init.can signal.dbc"),
    (Over, "canopen", "link.eds link.node link.heartbeat_ms init.sdo write.cob signal.object set.object"),
    (Over, "serial tcp udp scpi sysfs", "link.min_gap_ms init.send"),
    (Over, "serial tcp udp scpi", "link.tx_terminator link.rx_terminator"),
    (Over, "serial tcp scpi sysfs", ".query init.expect"),
    (Over, "serial tcp scpi", "link.unsolicited link.error_query set.send set.send_zero set.answer"),
    (Over, "serial tcp udp", "stream.line init.hex"),
    (Over, "udp", "link.local_port"),
    (By, LOOP, ".init .fault poll.sequence poll.device_time write.rate_hz set.safe link.min_gap_ms"),
    (By, LOOP, "link.unsolicited link.error_query link.backoff_first_ms link.backoff_longest_ms"),
    (By, "measure.vibration", "link.choice"),
    (With, ".set", "link.error_query"),
    (With, "stop", "stream.settle_ms stream.stop_before_open"),
    (With, "check", "stream.check_from stream.check_order stream.believed_after"),
    (With, "replies", "message.dbc_base message.multiplex"),
    (With, "cob", "message.length"),
    (With, "send", "init.expect"),
    (With, "registers", "init.table"),
    (With, "link.choice", "emulator.names"),
    (Without, ".stream", "link.unsolicited"),
    (Without, "stream.length", "link.rx_terminator"),
    (Without, "address", "poll.gap"),
    (Without, "start_register", "stream.start_function"),
    (Without, "line", "stream.sync stream.length stream.check vector.registers vector.hex"),
    (Without, "cob", "message.replies"),
    (Without, "length", "query.unit query.answer"),
    (Without, "answer", "query.unit"),
    (Without, "value object dbc", "signal.register signal.address signal.byte signal.type signal.byte_order"),
    (Without, "value object dbc", "signal.array"),
    (Without, "value", "signal.bits signal.object signal.dbc signal.scale_expr"),
    (Without, "object", "set.register set.type set.byte_order"),
];

/// Every table that has the key of a path, with the key's place and its value.
fn entries<'a, 'b>(
    root: &'a DeTable<'b>,
    path: &str,
) -> Vec<(&'a DeTable<'b>, std::ops::Range<usize>, &'a DeValue<'b>)> {
    let own = |table: &'a DeTable<'b>, key: &str| {
        table.get_key_value(key).map(|(name, value)| (table, name.span(), value.get_ref()))
    };
    let (section, key) = path.split_once('.').unwrap_or_default();
    let tables: Vec<&DeTable<'b>> = match own(root, section).map(|(.., value)| value) {
        None => section.is_empty().then_some(root).into_iter().collect(),
        Some(DeValue::Array(all)) => all.iter().filter_map(|one| one.get_ref().as_table()).collect(),
        Some(one) => one.as_table().into_iter().collect(),
    };
    tables.into_iter().filter_map(|table| own(table, key)).collect()
}

impl Compiler<'_> {
    /// Whether every key is read by somebody.
    pub(super) fn check_keys(&self) -> Result<(), ProfileError> {
        let root = DeTable::parse(self.text);
        let root = root.map_err(|error| ProfileError::at(self.text, error.span(), error.message()))?;
        let root = root.get_ref();
        let own = |path: &str| match entries(root, path).pop() {
            Some((.., DeValue::Array(all))) => all.iter().filter_map(|one| one.get_ref().as_str()).collect(),
            other => other.and_then(|(.., value)| value.as_str()).into_iter().collect::<Vec<_>>(),
        };
        let (kind, roles) = (own("link.kind"), own("profile.roles"));
        let paths =
            KEYS.iter().flat_map(|(read, words, paths)| paths.split(' ').map(move |p| (read, words, p)));
        for (read, words, path) in paths {
            for (table, place, value) in entries(root, path) {
                let has = |names: &[&str]| words.split(' ').any(|word| names.contains(&word));
                let beside = words.split(' ').find(|word| match word.contains('.') {
                    true => !entries(root, word).is_empty(),
                    false => table.contains_key(*word),
                });
                let list = words.trim_start_matches('.').replace(' ', ", ");
                let why = match (read, beside) {
                    (Over, _) if !has(&kind) => format!("over {}; it is for {list}", kind.concat()),
                    (By, _) if !has(&roles) => format!("by the role {}; it is for {list}", roles.join(", ")),
                    (With, None) => format!("without `{list}`"),
                    (Without, Some(beside)) => format!("beside `{}`", beside.trim_start_matches('.')),
                    _ => continue,
                };
                let shown = match (path.strip_prefix('.'), value) {
                    (Some(section), DeValue::Table(_)) => format!("[{section}]"),
                    (Some(section), _) => format!("[[{section}]]"),
                    (None, _) => format!("`{}`", path.split_once('.').unwrap_or_default().1),
                };
                let refusal = self.at(place, format!("{shown} is not read {why}"));
                return Err(refusal.with_help("remove it: nothing would act on it"));
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::{By, KEYS};

    /// A word of the table that no profile has would never refuse anything.
    #[test]
    fn every_word_of_the_table_is_one_of_the_language() {
        let schema = crate::schema::json_schema().as_value().to_string();
        for (read, words, paths) in KEYS {
            let words = words.split(' ').flat_map(|word| match read {
                By => vec![word],
                _ => word.split('.').collect(),
            });
            for word in words.chain(paths.split([' ', '.'])).filter(|word| !word.is_empty()) {
                assert!(schema.contains(&format!("\"{word}\"")), "{paths}: {word}");
            }
        }
    }
}
