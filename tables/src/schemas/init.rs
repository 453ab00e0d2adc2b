//! Commented beginnings of what people write. Each is a whole file that `muprime check` approves.

/// What can be begun.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Kind {
    /// A plan of passes
    Plan,
    /// A rig
    Setup,
    /// A fingertip
    Fingertip,
    /// An instrument's description
    Profile,
}

impl Kind {
    /// Its name, as it is typed.
    pub fn name(self) -> String {
        super::schema::typed(self)
    }

    /// Its schema: that of the same name.
    pub fn schema(self) -> serde_json::Value {
        let name = self.name();
        super::schema::Kind::all().find(|kind| kind.name() == name).map(|kind| kind.for_editors()).into()
    }
}

/// The file. Its first line names the schema by which editors complete; `init --out` writes it beside.
pub fn text(kind: Kind) -> String {
    let name = kind.name();
    format!(
        "#:schema ./{name}.schema.json\n# The line above lets editors complete and check: `muprime schema {name} > {name}.schema.json` writes that file.\n{}",
        body(kind)
    )
}

fn body(kind: Kind) -> String {
    match kind {
        Kind::Plan => include_str!("init/plan.toml").into(),
        Kind::Setup => include_str!("init/setup.toml").into(),
        Kind::Fingertip => include_str!("init/fingertip.toml").into(),
        Kind::Profile => {
            let example = drivers::bundled::text("muprime-force2").unwrap_or_default();
            let about = "# An instrument's description to begin with: the bundled muprime-force2, a two-axis force sensor behind Modbus TCP.\n\
                         # `muprime show` lists profiles of other buses; take the one that is nearest. docs/reference.md lists every key.\n\
                         # `muprime check FILE` runs the [[vector]] blocks: bytes as the manual prints them, with the values that they mean.\n\n";
            format!("{about}{}", example.replace("id = \"muprime-force2\"", "id = \"my-force-sensor\""))
        }
    }
}
