//! Foreign tables: ten sources of one and the same passes, each imported and compared with the truth to the
//! last digit, and sources that are refused or remarked on.

#[path = "import/truth.rs"]
mod source;

use source::{import, lines, moved, number, same, truth};
use std::fmt::Write;
use std::path::Path;
use tests::{documents, file, muprime, texts};

fn comma(text: &str) -> String {
    text.replace('.', ",")
}

/// Text tables: delimiters, decimal commas, units in headers and rows, comments, preambles, capitals, Latin-1, UTF-16, no vibration.
#[test]
fn text_tables_come_in_to_the_last_digit() {
    let folder = tempfile::tempdir().unwrap();
    let (moving, still) = (truth(false), truth(true));
    let write = |name: &str, bytes: &[u8]| {
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        path
    };
    let guess = ["--yes"];
    // 1: commas, units in brackets, a micro sign.
    let text = lines(&moving, "t [s],w_pp [µm],f [kHz],v [mm/s],dir,x [mm],FN [mN],FT [mN]", |t| {
        format!(
            "{},{},{},{},{},{},{},{}",
            t.time_s,
            moved(t.amplitude_nm.into(), 3),
            moved(t.frequency_hz.into(), 3),
            moved(t.speed_um_s.into(), 3),
            t.direction,
            moved(t.position_um.into(), 3),
            t.normal_mn,
            moved(t.lateral_un, 3)
        )
    });
    let one = import(folder.path(), &write("brackets.csv", text.as_bytes()), &guess);
    same(&one.passes, &moving, 0, "brackets");
    assert_eq!(one.passes[3].position_m, number(i64::from(moving[3].position_um), 6));
    assert_eq!(one.passes[3].frequency_hz, 27_513.0);
    // 2: semicolons and decimal commas, Latin-1, a preamble, a velocity with a sign.
    let text = comma(&lines(
        &moving,
        "t in s;Amplitude (µm);f (kHz);Velocity (mm/s);Normal force (N);Lateral force (N)",
        |t| {
            format!(
                "{};{};{};{};{};{}",
                t.time_s,
                moved(t.amplitude_nm.into(), 3),
                moved(t.frequency_hz.into(), 3),
                moved(i64::from(t.direction) * i64::from(t.speed_um_s), 3),
                moved(t.normal_mn.into(), 3),
                moved(t.lateral_un, 6)
            )
        },
    ));
    let text = format!("Versuch;Reihe 3\nBediener;M. Müller\n\n{text}");
    let latin: Vec<u8> = text.chars().map(|c| u8::try_from(u32::from(c)).unwrap()).collect();
    let two = import(folder.path(), &write("latin.csv", &latin), &guess);
    same(&two.passes, &moving, 0, "decimal commas");
    assert!(
        two.log["format"].as_str().unwrap().contains("Latin-1")
            && two.log["notes"].to_string().contains("Versuch")
    );
    // 3: tabs and capitals; MN in capitals is millinewton.
    let text = lines(&moving, "TIME_S\tAMP_PP_UM\tFREQ_KHZ\tSPEED_MM_S\tDIRECTION\tLOAD_MN\tFX_MN", |t| {
        format!(
            "{}\t{}\t{}\t{}\t{}\t{}\t{}",
            t.time_s,
            moved(t.amplitude_nm.into(), 3),
            moved(t.frequency_hz.into(), 3),
            moved(t.speed_um_s.into(), 3),
            if t.direction > 0 { "FWD" } else { "BWD" },
            t.normal_mn,
            moved(t.lateral_un, 3)
        )
    });
    same(
        &import(folder.path(), &write("capitals.tsv", text.as_bytes()), &guess).passes,
        &moving,
        0,
        "capitals",
    );
    // 4: blanks, the header in a comment, columns that are missing and set, UTF-16.
    let text = lines(&moving, "# made by hand\n# clock w dir u Fz Fx", |t| {
        format!(
            "  {}   {} {} {} {} {}",
            t.time_s,
            moved(t.amplitude_nm.into(), 3),
            t.direction,
            moved(t.speed_um_s.into(), 3),
            moved(-i64::from(t.normal_mn), 3),
            moved(t.lateral_un, 6)
        )
    });
    let wide: Vec<u8> = [0xfeff].into_iter().chain(text.encode_utf16()).flat_map(u16::to_le_bytes).collect();
    let map = "clock=time:s, w=amplitude_pp:um, dir=direction, u=speed:mm/s, Fz=normal_force:-N, Fx=lateral_force:N";
    let four =
        import(folder.path(), &write("wide.txt", &wide), &["--map", map, "--set", "frequency=27.513:kHz"]);
    same(&four.passes, &moving, 0, "blanks");
    assert_eq!(four.passes[5].frequency_hz, 27_513.0);
    // 5: a plain tribometer: no vibration, no frequency, no place, mass for load (one rounding more), a row of units.
    let text = lines(&still, "time|speed|direction|load|lateral force\ns|m/s|1|g|N", |t| {
        let grams = number(t.normal_mn.into(), 3) / 9.80665e-3;
        format!(
            "{}|{}|{}|{grams}|{}",
            t.time_s,
            moved(t.speed_um_s.into(), 6),
            t.direction,
            moved(t.lateral_un, 6)
        )
    });
    let five =
        import(folder.path(), &write("units.txt", text.as_bytes()), &["--yes", "--set", "amplitude_pp_m=0"]);
    // A mass is rounded where it is written and where it is read.
    same(&five.passes, &still, 2, "a row of units");
    let head = std::fs::read_to_string(folder.path().join("out-units.txt/points.csv")).unwrap();
    assert!(
        head.starts_with("point,time_s,amplitude_pp_m,speed_m_s,direction,normal_force_n,lateral_force_n\n"),
        "{head}"
    );
    // 6: a coefficient and peak amplitudes; a clock; the run; rows that cannot be taken are listed with their reason.
    let text = lines(&moving, "clock,test,half amplitude,freq,v_um_s,F,mu", |t| {
        let mu = number(t.lateral_un, 6) / number(t.normal_mn.into(), 3) * f64::from(t.direction);
        let velocity = i64::from(t.direction) * i64::from(t.speed_um_s);
        format!(
            "00:{:02}:{:02},A7,{},{},{velocity},{},{mu}",
            t.time_s / 60,
            t.time_s % 60,
            moved(5 * i64::from(t.amplitude_nm), 10),
            t.frequency_hz,
            moved(t.normal_mn.into(), 3)
        )
    });
    let text = format!(
        "{text}00:10:00,A7,broken,27513,5003,0.25,0.4\n00:10:01,A7,,27513,0,0.25,0.4\n00:10:02,A7,1e-6,27513,1,-0.25,0.4\n"
    );
    let map = "clock=time:s, test=run, half amplitude=amplitude_peak:m, freq=frequency:Hz, v_um_s=velocity:um/s, F=normal_force:N, mu=friction_coefficient";
    let six = import(folder.path(), &write("clock.csv", text.as_bytes()), &["--map", map]);
    same(&six.passes, &moving, 1, "a coefficient");
    assert!(six.passes.iter().all(|p| p.run.as_deref() == Some("A7")));
    let dropped = six.log["dropped"].as_array().unwrap();
    let told: Vec<_> = dropped
        .iter()
        .map(|d| (d["row"].as_u64().unwrap(), d["column"].as_str().unwrap(), d["reason"].as_str().unwrap()))
        .collect();
    assert_eq!(told[0], (26, "half amplitude", "no number"));
    assert_eq!((told[1].0, told[2].0, told.len()), (27, 28, 3), "{told:?}");
    assert!(texts(&six.output).1.contains("3 rows were left out"));
    // What comes out is what a diagnosis reads.
    for name in ["brackets.csv", "units.txt"] {
        let out = folder.path().join(format!("out-{name}"));
        let said = muprime().args(["diagnose", "--no-pairs", "--json"]).arg(&out).output().unwrap();
        assert_eq!(said.status.code(), Some(0), "{name}: {}", texts(&said).1);
        assert_eq!(documents(&said)[0]["data"]["points"], 24);
    }
}

fn refused(folder: &Path, text: &str, arguments: &[&str]) -> String {
    let source = folder.join("refused.csv");
    std::fs::write(&source, text).unwrap();
    let out = folder.join("refused");
    let output = muprime().arg("import").arg(&source).args(arguments).arg("-o").arg(&out).output().unwrap();
    assert_eq!(output.status.code(), Some(2), "{text}: {}", texts(&output).1);
    assert!(!out.exists(), "{text}: a folder was made");
    // Lines are broken to the width of the terminal.
    texts(&output).1.split_whitespace().filter(|w| *w != "│" && *w != "×").collect::<Vec<_>>().join(" ")
}

/// Everything that is missing at once, a guessed map that nobody confirmed, a wrong unit, what cannot be read.
#[test]
fn what_cannot_be_taken_is_refused_with_the_remedy() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let said = refused(folder, "t_s,fn_n\n1,2\n2,2\n", &["--yes"]);
    for missing in [
        "amplitude_pp_m is missing",
        "speed_m_s is missing",
        "direction is missing",
        "lateral_force_n is missing",
    ] {
        assert!(said.contains(missing), "{missing}: {said}");
    }
    assert!(!said.contains("normal_force_n is missing"));
    let whole = "t_s,w_um,f_khz,v_mm_s,dir,fn_n,ft_n\n0,1,27.5,10,1,0.25,0.1\n1,1,27.5,10,-1,0.25,-0.1\n";
    let said = refused(folder, whole, &[]);
    assert!(
        said.contains("must be confirmed") && said.contains("t_s=time:s, w_um=amplitude_pp:um"),
        "{said}"
    );
    assert!(
        refused(folder, whole, &["--map", "t_s=time:s, w_um=amplitude_pp:N"])
            .contains("'N' is not a unit of amplitude_pp")
    );
    assert!(refused(folder, whole, &["--map", "t_s=time"]).contains("needs a unit"));
    assert!(
        refused(folder, "t_s,w_um,v_mm_s,dir,fn_n,ft_n\n0,1,10,1,0.25,0.1\n", &["--yes"])
            .contains("frequency_hz is missing")
    );
    let negative = whole.replace("0.25", "-0.25");
    assert!(refused(folder, &negative, &["--yes"]).contains("normal_force:-N"));
    assert!(
        refused(folder, "MATLAB 5.0 MAT-file, made by hand", &["--yes"]).contains("cut short or damaged")
    );
    assert!(refused(folder, "\n\n", &["--yes"]).contains("no rows of numbers"));
    let header = "time (s);amplitude (um);speed (mm/s)\n";
    for (text, words) in [
        (header, "no rows of numbers below the header (line 1 is the last)"),
        (&format!("sep=;\n\n{header}s;um;mm/s\n"), "below the header (line 4 is the last)"),
        ("", "the file is empty"),
        ("# nothing yet\n", "the file holds comment lines alone"),
        ("a word\nanother\n", "no delimiter separates the lines"),
    ] {
        let said = refused(folder, text, &["--yes"]);
        assert!(said.contains(words), "{text}: {said}");
        assert_eq!(said.contains("give the delimiter"), text.starts_with("a word"), "{text}: {said}");
    }
    // The place is a file.
    let source = folder.join("refused.csv");
    let output = muprime().arg("import").arg(&source).args(["--yes", "-o"]).arg(&source).output().unwrap();
    assert_eq!(output.status.code(), Some(2));
    assert!(texts(&output).1.contains("name a folder, as in -o imported"), "{}", texts(&output).1);
    // A folder with a table is left as it is.
    let out = folder.join("taken");
    std::fs::create_dir(&out).unwrap();
    std::fs::write(out.join("points.csv"), "mine").unwrap();
    let output = muprime()
        .arg("import")
        .arg(folder.join("refused.csv"))
        .args(["--yes", "-o"])
        .arg(&out)
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(2));
    assert_eq!(std::fs::read_to_string(out.join("points.csv")).unwrap(), "mine");
}

/// A table with unreadable cells in three of four rows is refused, with the help that fits the cells.
#[test]
fn a_table_of_mostly_unreadable_rows_is_refused_with_a_help_for_each_reason() {
    let folder = tempfile::tempdir().unwrap();
    let table = |every: u32, time: &str, lateral: &str, direction: &str| {
        let mut text = String::from("t_s;w_um;f_khz;v_mm_s;dir;fn_n;ft_n\n");
        for k in 0..24 {
            let or = |good: String, bad: &str| {
                if k % every == 0 || bad.is_empty() { good } else { bad.to_string() }
            };
            let (t, ft, dir) =
                (or(k.to_string(), time), or(format!("0,1{k}"), lateral), or("1".into(), direction));
            writeln!(text, "{t};1,5;27,5;10;{dir};0,25;{ft}").unwrap();
        }
        text
    };
    for (time, lateral, direction, words) in [
        ("", "OVL", "", "'OVL' is no number"),
        ("", "1.200,0", "", "without thousands separators"),
        ("later", "", "", "01.03.2024 12:34:56"),
        ("", "", "up", "forward or backward is needed"),
    ] {
        let said = refused(folder.path(), &table(4, time, lateral, direction), &["--yes"]);
        assert!(said.contains("6 of 24 rows can be taken") && said.contains(words), "{words}: {said}");
    }
    // Half of the rows are enough, and lines of text are no rows.
    let path = folder.path().join("half.csv");
    std::fs::write(&path, table(2, "", "OVL", "").replace("\n4;", "\nload changed\n4;")).unwrap();
    let half = import(folder.path(), &path, &["--yes"]);
    assert_eq!((half.passes.len(), half.log["dropped"].as_array().unwrap().len()), (12, 13));
    // A record of samples is no exception.
    let mut record = String::from("t_s;x_mm;fn_n;ft_n\n");
    for k in 0..400 {
        let lateral = if k % 4 > 0 { "OVL".into() } else { "0,1".to_string() };
        writeln!(
            record,
            "{};{};0,25;{lateral}",
            comma(&format!("{:.2}", f64::from(k) * 0.01)),
            comma(&format!("{:.1}", f64::from(k) * 0.1))
        )
        .unwrap();
    }
    let said = refused(folder.path(), &record, &["--series", "--yes", "--set", "amplitude_pp_m=0"]);
    assert!(said.contains("100 of 400 rows can be taken"), "{said}");
}

/// One entry of a map leaves the rest to the guess, which must be confirmed; a whole map is taken as it is.
#[test]
fn what_a_map_leaves_open_is_guessed_and_confirmed() {
    let folder = tempfile::tempdir().unwrap();
    let text = lines(&truth(false), "t,A,f,v,dir,FN,FT,Temp\ns,um pp,kHz,mm/s,-,N,N,degC", |t| {
        format!(
            "{},{},27.513,{},{},{},{},21",
            t.time_s,
            moved(t.amplitude_nm.into(), 3),
            moved(t.speed_um_s.into(), 3),
            t.direction,
            moved(t.normal_mn.into(), 3),
            moved(t.lateral_un, 6)
        )
    });
    let path = folder.path().join("rows.csv");
    std::fs::write(&path, &text).unwrap();
    let said = refused(folder.path(), &text, &["--map", "A=amplitude_pp:um"]);
    let whole = "A=amplitude_pp:um, t=time:s, f=frequency:kHz, v=speed:mm/s, dir=direction, FN=normal_force:N, FT=lateral_force:N";
    assert!(said.contains("must be confirmed") && said.contains(whole), "{said}");
    assert!(said.contains("What --map leaves open"), "{said}");
    // The unit is in the second row.
    let part = import(folder.path(), &path, &["--map", "A=amplitude_pp:um, t=time", "--yes"]);
    same(&part.passes, &truth(false), 0, "the rest is guessed");
    let all = folder.path().join("all.csv");
    std::fs::copy(&path, &all).unwrap();
    let all = import(folder.path(), &all, &["--map", whole]);
    same(&all.passes, &truth(false), 0, "a whole map");
    assert!(all.log["not_taken"].to_string().contains("Temp"));
    // What is set is not guessed as well, time by rows neither.
    let rows = folder.path().join("set.csv");
    std::fs::copy(&path, &rows).unwrap();
    import(folder.path(), &rows, &["--map", "A=amplitude_pp:um", "--set", "time_s=rows", "--yes"]);
    // All that is missing is reported at once; a position without a speed may be that of a record.
    let said = refused(folder.path(), "x_mm;fn_n;ft_n\n1;2;3\n2;2;3\n", &["--yes", "--set", "time_s=rows"]);
    for words in ["amplitude_pp_m is missing", "frequency_hz is missing", "or --series if"] {
        assert!(said.contains(words), "{words}: {said}");
    }
    let twice = format!("{whole}, #8=time:s");
    let said = refused(folder.path(), &text, &["--map", &twice]);
    assert!(said.contains("time_s is given more than once") && said.contains("keep one of them"), "{said}");
    assert!(!said.contains("state what is missing"), "{said}");
    // A column whose header another one has is named by its number in the map that is printed.
    let doubled = text.replace(",Temp", ",v");
    let said = refused(folder.path(), &doubled, &["--map", "A=amplitude_pp:um, #4=speed:mm/s"]);
    assert!(said.contains("#4=speed:mm/s, t=time:s"), "{said}");
}

/// A unit in the map that is not that of the header is remarked on; a sign is no other unit.
#[test]
fn a_unit_that_contradicts_the_header_is_remarked_on() {
    let folder = tempfile::tempdir().unwrap();
    let head = "t (s),A,f [kHz],v_mm_s,dir,Normalkraft (N),FT";
    let text = lines(&truth(false), head, |t| {
        format!(
            "{},{},27.513,{},{},{},{}",
            t.time_s,
            moved(t.amplitude_nm.into(), 3),
            moved(t.speed_um_s.into(), 3),
            t.direction,
            moved(t.normal_mn.into(), 3),
            moved(t.lateral_un, 6)
        )
    });
    let map = |speed: &str, force: &str, lateral: &str| {
        format!(
            "t (s)=time:s, A=amplitude_pp:um, f [kHz]=frequency:kHz, v_mm_s=speed:{speed}, dir=direction, \
             Normalkraft (N)=normal_force:{force}, FT=lateral_force:{lateral}"
        )
    };
    let taken = |name: &str, map: &str| {
        let path = folder.path().join(name);
        std::fs::write(&path, &text).unwrap();
        import(folder.path(), &path, &["--map", map])
    };
    let words = "Normalkraft (N): the header says N, the map says mN";
    let wrong = taken("wrong.csv", &map("m/s", "mN", "mN"));
    assert_eq!(wrong.passes[0].normal_force_n, 0.247e-3, "nothing is repaired");
    let said = wrong.log["remarks"].to_string();
    assert!(said.contains(words), "{said}");
    assert!(said.contains("v_mm_s: the header says mm/s, the map says m/s"), "{said}");
    assert!(texts(&wrong.output).1.contains(words));
    let right = taken("right.csv", &map("mm/s", "N", "N"));
    assert_eq!(right.log["remarks"].to_string(), "[]");
    let turned = taken("turned.csv", &map("mm/s", "N", "-N"));
    assert!(!turned.log["remarks"].to_string().contains("the header says"), "{}", turned.log["remarks"]);
    // Where the wrong unit makes the rows impossible, the refusal names it.
    let said = refused(folder.path(), &text, &["--map", &map("mm/s", "mN", "N")]);
    assert!(said.contains("0 of 24 rows can be taken") && said.contains(words), "{said}");
}

/// German dates and headers; ambiguous dates stay refused.
#[test]
fn german_dates_ways_and_headers_are_read() {
    let folder = tempfile::tempdir().unwrap();
    let head = "Uhrzeit\tSchwingungsamplitude Spitze-Spitze in µm\tFrequenz in kHz\tGeschwindigkeit in mm/s\tRichtung\tAnpresskraft in N\tQuerkraft in mN\tReibwert";
    let text = lines(&truth(false), head, |t| {
        let second = 86_390 + t.time_s;
        let (day, s) = (1 + second / 86_400, second % 86_400);
        let time = format!("{day:02}.03.2024 {:02}:{:02}:{:02},500", s / 3600, s / 60 % 60, s % 60);
        let way = if t.direction > 0 { "vor" } else { "zurück" };
        comma(&format!(
            "T\t{}\t27.513\t{}\t{way}\t{}\t{}\t0.5",
            moved(t.amplitude_nm.into(), 3),
            moved(t.speed_um_s.into(), 3),
            moved(t.normal_mn.into(), 3),
            moved(t.lateral_un, 3)
        ))
        .replacen('T', &time, 1)
    });
    let path = folder.path().join("german.txt");
    std::fs::write(&path, &text).unwrap();
    same(&import(folder.path(), &path, &["--yes"]).passes, &truth(false), 0, "german");
    let said = refused(folder.path(), &text.replace(".03.2024", "/03/2024"), &["--yes"]);
    assert!(said.contains("map the column as time:mdy or time:dmy"), "{said}");
}

/// Units that slipped by a thousand or a million are remarked on, never repaired; so are magnitudes in both directions.
#[test]
fn slipped_units_and_lost_signs_are_remarked_on() {
    let folder = tempfile::tempdir().unwrap();
    let table = |name: &str, unsigned: bool| {
        let text = lines(&truth(false), "t,w,f,v,dir,fn,ft", |t| {
            let lateral = if unsigned { t.lateral_un.abs() } else { t.lateral_un };
            format!(
                "{},{},{},{},{},{},{}",
                t.time_s,
                moved(t.amplitude_nm.into(), 3),
                t.frequency_hz,
                moved(t.speed_um_s.into(), 6),
                t.direction,
                moved(t.normal_mn.into(), 3),
                moved(lateral, 6)
            )
        });
        let path = folder.path().join(name);
        std::fs::write(&path, text).unwrap();
        path
    };
    let remarks = |name: &str, units: [&str; 3], unsigned: bool| {
        let map = format!(
            "t=time:s, w=amplitude_pp:{}, f=frequency:{}, v=speed:m/s, dir=direction, fn=normal_force:N, ft={}",
            units[0], units[1], units[2]
        );
        import(folder.path(), &table(name, unsigned), &["--map", &map]).log["remarks"].to_string()
    };
    let right = remarks("right.csv", ["um", "Hz", "lateral_force:N"], false);
    assert_eq!(right, "[]");
    let slipped = remarks("slipped.csv", ["nm", "mHz", "lateral_force:uN"], false);
    assert!(
        slipped.contains("amplitude_pp_m: 0.00151") && slipped.contains("a thousand times too small"),
        "{slipped}"
    );
    assert!(
        slipped.contains("frequency_hz: 0.0275") && slipped.contains("lateral over normal force"),
        "{slipped}"
    );
    let unsigned = remarks("unsigned.csv", ["um", "Hz", "lateral_force:N"], true);
    assert!(unsigned.contains("friction_force in place of lateral_force"), "{unsigned}");
    assert_eq!(remarks("magnitudes.csv", ["um", "Hz", "friction_force:N"], true), "[]");
    let turned = remarks("turned.csv", ["um", "Hz", "lateral_force:-N"], false);
    assert!(turned.contains("friction pushes along the sliding: the lateral axis is reversed"), "{turned}");
}

/// A record of strokes to and fro, each with a step of velocity within: a pass a stretch, in every one the
/// speed and the friction that went in.
#[test]
fn a_series_is_cut_at_reversals_and_steps() {
    let folder = tempfile::tempdir().unwrap();
    let (rate, mut text) = (500.0, String::from("t_s;x_mm;Fz_N;Fx_N\n"));
    let (mut k, mut x) = (0u32, 0.0f64);
    let mut wanted = Vec::new();
    let mut chance = 1u64;
    for stroke in 0..10 {
        let direction = if stroke % 2 == 0 { 1.0 } else { -1.0 };
        for (part, speed) in [(0, 0.010), (1, 0.020)] {
            let friction = direction * 0.25 * (0.4 + 0.05 * f64::from(part) + 0.002 * f64::from(stroke));
            wanted.push((speed, direction, friction));
            // 10 mm each.
            for _ in 0..(0.010 / speed * rate) as usize {
                chance =
                    chance.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                let noise = ((chance >> 33) as f64 / f64::from(1u32 << 31) - 0.5) * 2e-3;
                x += direction * speed / rate;
                writeln!(
                    text,
                    "{:.3};{:.5};{:.6};{:.6}",
                    f64::from(k) / rate,
                    x * 1e3,
                    0.25 + noise,
                    friction + noise
                )
                .unwrap();
                k += 1;
            }
        }
    }
    let source = folder.path().join("strokes.csv");
    std::fs::write(&source, text.replace('.', ",")).unwrap();
    let made = import(folder.path(), &source, &["--series", "--yes", "--set", "amplitude_pp_m=0"]);
    assert_eq!(made.passes.len(), wanted.len(), "{}", made.log["series"]);
    for (p, (speed, direction, friction)) in made.passes.iter().zip(&wanted) {
        assert!((p.speed_m_s / speed - 1.0).abs() < 1e-3, "{} {speed}", p.speed_m_s);
        assert_eq!(p.direction.sign(), *direction);
        assert!((p.lateral_force_n.unwrap() - friction).abs() < 2e-4, "{:?} {friction}", p.lateral_force_n);
        assert!(p.samples.unwrap() > 100 && p.lateral_force_sd_n.unwrap() < 1e-3);
    }
    let series = &made.log["series"];
    assert_eq!(series["reversals"], 9);
    let parts: u64 =
        ["in_passes", "changing", "settling", "too_short"].iter().map(|k| series[*k].as_u64().unwrap()).sum();
    assert_eq!(parts, u64::from(k), "every sample is accounted for: {series}");
    let windows = folder.path().join("windows.csv");
    std::fs::copy(&source, &windows).unwrap();
    let more = import(
        folder.path(),
        &windows,
        &["--series", "--window-s", "0.1", "--settle-s", "0.1", "--yes", "--set", "amplitude_pp_m=0"],
    );
    assert!(more.passes.len() > 2 * wanted.len(), "{}", more.passes.len());
    let jumps = text.replacen("0.004;", "9.004;", 1);
    let said = refused(folder.path(), &jumps, &["--series", "--yes", "--set", "amplitude_pp_m=0"]);
    assert!(said.contains("the time does not rise"), "{said}");
}

/// The rock record that others published: one step of velocity. The windows that were made of it by a script of its own say the same.
#[test]
fn a_published_velocity_step_is_cut_as_its_authors_did() {
    let folder = tempfile::tempdir().unwrap();
    let source = file("tests/recordings/rock-velocity-steps/velstep4_excerpt.txt");
    let text = std::fs::read_to_string(&source).unwrap();
    println!("{}", text.lines().take(3).collect::<Vec<_>>().join("\n"));
    let map = "#1=time:s, #2=position:um, #3=friction_coefficient";
    let made = import(
        folder.path(),
        &source,
        &[
            "--series",
            "--window-s",
            "5",
            "--map",
            map,
            "--set",
            "amplitude_pp_m=0,direction=1,normal_force_n=0.2",
        ],
    );
    let speeds: Vec<f64> = made.passes.iter().map(|p| p.speed_m_s * 1e6).collect();
    println!("{speeds:?} {}", made.log["series"]);
    // 3 to 10 um/s; the slow part of the excerpt is a second, in which the record's own slope scatters by a tenth.
    assert_eq!(speeds.len(), 2, "{speeds:?}");
    assert!((speeds[0] / 3.0 - 1.0).abs() < 0.1 && (speeds[1] / 10.0 - 1.0).abs() < 0.01, "{speeds:?}");
    // The mean of the record's own friction column over the same samples.
    let rows: Vec<Vec<f64>> =
        text.lines().skip(1).map(|l| l.split_whitespace().map(|c| c.parse().unwrap()).collect()).collect();
    for p in &made.passes {
        let first = rows.iter().position(|r| r[0] == p.time_s).unwrap();
        let own = &rows[first..first + p.samples.unwrap() as usize];
        let mean = own.iter().map(|r| r[2]).sum::<f64>() / own.len() as f64;
        let friction = p.lateral_force_n.unwrap() / p.normal_force_n;
        assert!((friction / mean - 1.0).abs() < 1e-12, "{friction} {mean}");
    }
}
