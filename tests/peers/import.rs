//! Tables in binary formats, written by openpyxl, pyarrow, numpy, scipy and h5py: each imported and compared with the truth to the last digit.

#[path = "../import/truth.rs"]
#[allow(dead_code, reason = "tests/import.rs uses all of it")]
mod source;

use source::{import, lines, moved, same, truth};
use tests::{file, muprime, python, texts};

/// Excel, Parquet and NumPy, written by openpyxl, pyarrow and numpy.
#[test]
fn binary_tables_come_in_to_the_last_digit() {
    let folder = tempfile::tempdir().unwrap();
    let moving = truth(false);
    let table = lines(&moving, "t_s,w_um,f_khz,v_mm_s,dir,fn_mn,ft_mn", |t| {
        format!(
            "{},{},{},{},{},{},{}",
            t.time_s,
            moved(t.amplitude_nm.into(), 3),
            moved(t.frequency_hz.into(), 3),
            moved(t.speed_um_s.into(), 3),
            t.direction,
            t.normal_mn,
            moved(t.lateral_un, 3)
        )
    });
    let csv = folder.path().join("table.csv");
    std::fs::write(&csv, table).unwrap();
    let made =
        python().arg(file("tests/peers/foreign_tables.py")).arg(&csv).arg(folder.path()).output().unwrap();
    assert!(made.status.success(), "{}", texts(&made).1);
    let map = "t_s=time:s, w_um=amplitude_pp:um, f_khz=frequency:kHz, v_mm_s=speed:mm/s, dir=direction, fn_mn=normal_force:mN, ft_mn=lateral_force:mN";
    let matrix = "#1=time:s, #2=amplitude_pp:um, #3=frequency:kHz, #4=speed:mm/s, #5=direction, #6=normal_force:mN, #7=lateral_force:mN";
    // 7 to 16.
    for (name, arguments) in [
        ("book.xlsx", vec!["--yes", "--sheet", "Friction"]),
        ("table.parquet", vec!["--yes"]),
        ("records.npy", vec!["--map", map]),
        ("matrix.npy", vec!["--map", matrix]),
        ("columns.mat", vec!["--map", map]),
        ("packed.mat", vec!["--sheet", "sweep", "--map", map]),
        ("matrix.mat", vec!["--map", matrix]),
        ("new.mat", vec!["--map", matrix]),
        ("table.h5", vec!["--sheet", "run/sweep", "--map", map]),
        ("matrix.h5", vec!["--map", matrix]),
    ] {
        same(&import(folder.path(), &folder.path().join(name), &arguments).passes, &moving, 0, name);
    }
    let several = muprime()
        .arg("import")
        .arg(folder.path().join("book.xlsx"))
        .args(["--yes", "-o"])
        .arg(folder.path().join("none"))
        .output()
        .unwrap();
    assert_eq!(several.status.code(), Some(2));
    assert!(texts(&several).1.contains("'Notes', 'Friction'"), "{}", texts(&several).1);
}

/// Arrays of several lengths are listed; a file that is cut, or whose sizes lie, ends with words and not otherwise.
#[test]
fn files_of_arrays_are_refused_in_words() {
    let folder = tempfile::tempdir().unwrap();
    let csv = folder.path().join("plain.csv");
    let header = "t_s,w_um,f_khz,v_mm_s,dir,fn_mn,ft_mn";
    let rows: String = (1..20).map(|k| format!("{k},1,27.5,10,1,250,{k}\n")).collect();
    std::fs::write(&csv, format!("{header}\n{rows}")).unwrap();
    let made =
        python().arg(file("tests/peers/foreign_tables.py")).arg(&csv).arg(folder.path()).output().unwrap();
    assert!(made.status.success(), "{}", texts(&made).1);
    let import = |name: &str, bytes: &[u8]| {
        let (source, out) = (folder.path().join(name), folder.path().join("out"));
        std::fs::write(&source, bytes).unwrap();
        let output = muprime().arg("import").arg(&source).args(["--yes", "-o"]).arg(&out).output().unwrap();
        (output.status.code(), texts(&output).1)
    };
    // Arrays of the commonest length are the table; what is left over is noted.
    for (name, rest) in [("packed.mat", "raw (1000 x 1)"), ("table.h5", "another length were passed over")] {
        let (code, said) = import("several.bin", &std::fs::read(folder.path().join(name)).unwrap());
        let words = said.split_whitespace().filter(|w| *w != "│").collect::<Vec<_>>().join(" ");
        assert_eq!(code, Some(0), "{said}");
        assert!(words.contains(rest), "{name}: {words}");
        std::fs::remove_dir_all(folder.path().join("out")).unwrap();
    }
    // Wherever it is cut and whichever byte is another: status 0 or 2, never a panic.
    for name in ["columns.mat", "packed.mat", "table.h5", "new.mat"] {
        let whole = std::fs::read(folder.path().join(name)).unwrap();
        for k in 1..12 {
            let cut = whole.len() * k / 12;
            let mut other = whole.clone();
            other[cut] ^= 0x5a;
            for bytes in [&whole[..cut], &other[..]] {
                let (code, said) = import("hurt.bin", bytes);
                assert!(matches!(code, Some(0 | 2)), "{name} at {cut}: {code:?} {said}");
                let _ = std::fs::remove_dir_all(folder.path().join("out"));
            }
        }
    }
}
