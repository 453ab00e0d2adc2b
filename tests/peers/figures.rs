//! The paper's figures as a journal prints them, looked at by a PDF reader and an XML parser that know nothing of this program.

use serde_json::Value;
use tests::{documents, muprime, python, texts};

/// What a reader finds in `NAME.pdf` and `NAME.svg`.
const LOOK: &str = "import sys, json, pypdf, xml.etree.ElementTree as x\n\
    name = sys.argv[1]; pdf = pypdf.PdfReader(name + '.pdf'); box = pdf.pages[0].mediabox\n\
    svg = x.parse(name + '.svg').getroot()\n\
    words = [''.join(t.itertext()).strip() for t in svg.iter('{http://www.w3.org/2000/svg}text')]\n\
    print(json.dumps({'pages': len(pdf.pages), 'mm': float(box.width) / 72 * 25.4,\n\
        'text': pdf.pages[0].extract_text(), 'svg_width': svg.get('width'), 'words': words,\n\
        'fonts': sorted(f.get_object()['/BaseFont'] for f in pdf.pages[0]['/Resources']['/Font'].values())}))";

fn look(at: &std::path::Path) -> Value {
    let seen = python().args(["-c", LOOK]).arg(at).output().unwrap();
    assert!(seen.status.success(), "{}", texts(&seen).1);
    serde_json::from_slice(&seen.stdout).unwrap()
}

/// One page of one or two columns' width; every word of the SVG is text in the PDF; axis titles with units;
/// the parametric study's five panels stand in one figure, and what the paper states is marked.
#[test]
fn figures_are_as_a_journal_prints_them() {
    let folder = tempfile::tempdir().unwrap();
    for (figure, width_mm, said) in [
        ("fig4", 174.0, &["Contact phase shift (deg)", "transition (paper)", "plateau (paper)", "(b)"][..]),
        ("fig7", 85.0, &["Reaction force (N)", "Time (periods)", "applied (paper)"]),
        ("fig9", 174.0, &["Relative friction \u{b5}'", "(e)", "f = 27.5 kHz", "U = 5 mm/s", "F = 0.25 N"]),
        ("fig11", 174.0, &["Amplitude w, peak-to-peak (\u{b5}m)", "(a)", "(b)", "k_n 0.2 MN/m"]),
        (
            "fig12",
            85.0,
            &["\u{3a8} (Eq. 17)", "\u{3a8}* 2.38 \u{b1} 0.21 (paper)", "(refit)", "Young's modulus"],
        ),
        ("fig14", 85.0, &["Relative friction \u{b5}'", "1.5 mm/s"]),
    ] {
        let mut command = muprime();
        command.args([
            "--json",
            "model",
            "reproduce",
            figure,
            "--style",
            "paper",
            "--elements",
            "150",
            "--out",
        ]);
        let made = command.arg(folder.path()).output().unwrap();
        assert_eq!(made.status.code(), Some(0), "{figure}: {}", texts(&made).1);
        for name in documents(&made)[0]["files"].as_array().unwrap() {
            assert!(folder.path().join(name.as_str().unwrap()).exists(), "{figure}: {name}");
        }
        let seen = look(&folder.path().join(figure));
        assert_eq!(seen["pages"], 1, "{figure}");
        assert!((seen["mm"].as_f64().unwrap() - width_mm).abs() < 0.1, "{figure}: {}", seen["mm"]);
        assert_eq!(seen["svg_width"], format!("{width_mm:.2}mm"), "{figure}");
        let plain = |text: &str| text.split_whitespace().collect::<String>();
        let text = plain(seen["text"].as_str().unwrap());
        for word in seen["words"].as_array().unwrap() {
            assert!(
                text.contains(&plain(word.as_str().unwrap())),
                "{figure}: {word} is not in the PDF: {text}"
            );
        }
        for word in said {
            assert!(text.contains(&plain(word)), "{figure}: '{word}': {text}");
        }
    }
    // For a screen each chart stays by itself.
    let mut command = muprime();
    let made = command
        .args(["model", "reproduce", "fig11", "--out"])
        .arg(folder.path().join("screen"))
        .output()
        .unwrap();
    assert_eq!(made.status.code(), Some(0), "{}", texts(&made).1);
    assert!(folder.path().join("screen/fig11_acceleration.svg").exists());
    assert!(!folder.path().join("screen/fig11.pdf").exists());
}
