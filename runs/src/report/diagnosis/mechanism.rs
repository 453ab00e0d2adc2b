//! Where a cause acts, as a small drawing: finger, contact, air, plate, instruments; the part that acts is
//! filled.

use effects::{Effect, Location};

/// Causes of which the contact is one through air.
const IN_AIR: [&str; 1] = ["squeeze_film"];

/// The parts of the drawing, from above: name, outline, and where the name is written.
const PARTS: [(&str, &str, [u32; 2]); 5] = [
    ("finger", "M40 6 H96 Q112 40 84 56 H52 Q24 40 40 6 Z", [68, 30]),
    ("contact", "M52 58 H84 V62 H52 Z", [148, 64]),
    ("air", "M22 64 H114 V70 H22 Z", [148, 78]),
    ("plate", "M12 72 H124 V84 H12 Z", [68, 102]),
    ("instruments", "M54 106 H82 V122 H54 Z", [136, 118]),
];

/// The drawing of a cause.
pub fn drawing(effect: &Effect) -> String {
    let place = match effect.place {
        Location::Contact if IN_AIR.contains(&effect.name) => "air",
        Location::Contact => "contact",
        Location::Finger => "finger",
        Location::Plate => "plate",
        Location::Instrument => "instruments",
    };
    let part = |(name, outline, [x, y]): &(&str, &str, [u32; 2])| {
        let (fill, weight) = if *name == place { ("#d55e00", "700") } else { ("#ececec", "400") };
        format!(
            "<path d=\"{outline}\" fill=\"{fill}\" stroke=\"#444\"/>\
             <text x=\"{x}\" y=\"{y}\" font-size=\"12\" font-weight=\"{weight}\" text-anchor=\"middle\" \
             font-family=\"sans-serif\" fill=\"#000\">{name}</text>"
        )
    };
    let parts: String = PARTS.iter().map(part).collect();
    // The plate swings up and down, the finger slides along it, and the force is read below it.
    format!(
        "<svg viewBox=\"0 0 190 126\" role=\"img\" aria-label=\"Where it acts: {place}.\">{parts}\
         <path d=\"M18 48 V64 M14 53 L18 48 L22 53 M14 59 L18 64 L22 59 M112 22 H136 M131 18 L136 22 L131 26\" \
         fill=\"none\" stroke=\"#444\"/></svg>"
    )
}
